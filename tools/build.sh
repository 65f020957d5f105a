#!/bin/bash
# Build the workspace with the Python of .venv, so that its executables start with that Python.
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
if [ -z "${ROS_DISTRO:-}" ] && [ -f /opt/ros/jazzy/setup.bash ]; then
  set +u; . /opt/ros/jazzy/setup.bash; set -u
fi
python=$root/.venv/bin/python
export PATH="$root/.venv/bin:$PATH"
if [ -d .venv/share/ament_index ]; then
  export AMENT_PREFIX_PATH="$root/.venv" CMAKE_PREFIX_PATH="$root/.venv"
fi
# What was renamed or deleted since the last build would stay importable; compiled loops may stay.
for package in ros2_ws/src/*/setup.py; do
  name=$(basename "$(dirname "$package")")
  rm -rf "ros2_ws/build/$name"
  for site in ros2_ws/install/"$name"/lib/python3*/site-packages; do
    [ -d "$site" ] || continue
    rm -rf "$site"/"$name"*.egg-info
    find "$site/$name" -name '*.py' -delete
  done
done
mkdir -p ros2_ws/log
log=ros2_ws/log/build.txt
# Else no job would begin while the machine has anything else to do.
export MAKEFLAGS=${MAKEFLAGS:--j$(nproc)}
# Generated sources share most of what they include: compiled together they take half the time.
echo 'Building the workspace ...'
if ! (cd ros2_ws && "$python" -m colcon --log-base log build --event-handlers console_cohesion+ \
  --cmake-args -GNinja -DBUILD_TESTING=OFF -DCMAKE_UNITY_BUILD=ON "-DPython3_EXECUTABLE=$python" \
  "-DPYTHON_EXECUTABLE=$python") >"$log" 2>&1; then
  tail -n 60 "$log" >&2
  echo "The build failed; the whole output is in $log." >&2
  exit 1
fi
if [ -n "${PYTHONDONTWRITEBYTECODE:-}" ]; then
  # Else each process would compile again what it imports: half the time that a node takes to start.
  "$python" -m compileall -qq -j 0 -x '/tests?/' .venv/lib ros2_ws/install ros2_ws/src || true
fi
echo 'Compiling the hot loops ...'
set +u; source ./env.sh; set -u
python tools/compile_kernels.py demo
touch ros2_ws/install/.built
