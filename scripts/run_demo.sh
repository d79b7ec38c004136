#!/usr/bin/env bash
# The demo: on a real ROS graph where ROS is set up, else the same way without it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. scripts/env.sh
if [ -e .deps/without_ros ]; then
  python -m examples.demo.offline --output demo_output "$@"
  cat .deps/without_ros
else
  exec python -m examples.demo.ros --output demo_output "$@"
fi
