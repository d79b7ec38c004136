#!/usr/bin/env bash
# Build the package with colcon into .deps/install, linked to the sources.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. scripts/env.sh
python -c 'import rclpy, sensor_msgs.msg'
python -m colcon --log-base .deps/log build --base-paths . --symlink-install \
  --build-base .deps/build --install-base .deps/install
ln -sf ../../install/lip_id_ros/lib/lip_id_ros/lip_id .deps/venv/bin/lip_id
