#!/bin/bash
# Run all tests in two streams of about the same time side by side: those of running nodes and
# connectors, which wait most of their time, and all others: first what starts nothing, at low
# priority, then the page and OPC UA.
# What is given is passed on to pytest.
set -uo pipefail
cd "$(dirname "$0")/.."

stream() {
  local name=$1 which=$2
  shift 2
  # ends as the nodes end: the middleware may spin at the end of this process, too
  python -c '
import sys, pytest
from damadics_fd.leave import ending
sys.exit(ending(lambda: int(pytest.main())))
' -m "$which" -o pythonpath=tests -o "cache_dir=.pytest_cache/$name" "$@"
}

beside() {
  (renice -n 5 "$BASHPID" > /dev/null; stream others 'not slow and not ros' "$@")
  others=$?
  stream page 'not slow and ros and (page or opcua)' "$@"
  merged "$others" $?
}

# Return one code for two; pytest ends with 5 where a stream has no test that was asked for.
merged() {
  local code
  for code in "$@"; do
    [[ $code == 0 || $code == 5 ]] || return 1
  done
  [[ $1 == 0 || $2 == 0 ]] || return 5
}

output=$(mktemp)
trap 'kill "${beside:-}" 2> /dev/null; rm -f "$output"' EXIT
echo 'Testing in two streams: nodes and connectors here, the others beside it (shown when done) ...'
beside "$@" > "$output" 2>&1 &
beside=$!
stream nodes 'not slow and ros and not page and not opcua' "$@"
nodes=$?
wait "$beside"
rest=$?
beside=
cat "$output"
merged "$nodes" "$rest"
