# Put ros2, Python and the built workspace on the path: `source env.sh` in bash or zsh.
# An installed ROS 2 Jazzy is used where there is one; elsewhere ROS 2 comes from .venv.

_damadics_env() {
  local root="$1" shell=bash site dir
  [ -n "${ZSH_VERSION:-}" ] && shell=zsh
  if [ ! -x "$root/.venv/bin/python" ]; then
    echo "env.sh: the project is not built yet: run 'make build' in $root first." >&2
    return 1
  fi
  if [ -z "${ROS_DISTRO:-}" ] && [ -f "/opt/ros/jazzy/setup.$shell" ]; then
    . "/opt/ros/jazzy/setup.$shell"
  fi
  case ":$PATH:" in *":$root/.venv/bin:"*) ;; *) export PATH="$root/.venv/bin:$PATH" ;; esac
  export VIRTUAL_ENV="$root/.venv"
  if [ -d "$root/.venv/share/ament_index" ]; then  # ROS 2 from wheels
    site=$(echo "$root"/.venv/lib/python3.*/site-packages)
    for dir in "$root/.venv/lib" "$site"/ros_*.libs; do
      case ":${LD_LIBRARY_PATH:-}:" in
        *":$dir:"*) ;;
        *) LD_LIBRARY_PATH="${LD_LIBRARY_PATH:+$LD_LIBRARY_PATH:}$dir" ;;
      esac
    done
    case ":${AMENT_PREFIX_PATH:-}:" in
      *":$root/.venv:"*) ;;
      *) AMENT_PREFIX_PATH="${AMENT_PREFIX_PATH:+$AMENT_PREFIX_PATH:}$root/.venv" ;;
    esac
    export LD_LIBRARY_PATH AMENT_PREFIX_PATH
    export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1  # the libraries are on the path: no second start
  fi
  if ! command -v ros2 >/dev/null 2>&1; then
    export PATH="$root/tools/bin:$PATH"
  fi
  if [ -f "$root/ros2_ws/install/local_setup.$shell" ]; then
    . "$root/ros2_ws/install/local_setup.$shell"
  else
    echo "env.sh: the workspace is not built yet: run 'make build' in $root." >&2
    return 1
  fi
}

if [ -n "${BASH_VERSION:-}" ]; then
  _damadics_env "$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
elif [ -n "${ZSH_VERSION:-}" ]; then
  _damadics_env "$(cd "$(dirname "${(%):-%x}")" && pwd)"
else
  echo 'env.sh: source it in bash or zsh.' >&2
  false
fi
