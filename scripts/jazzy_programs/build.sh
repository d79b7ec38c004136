#!/usr/bin/env bash
# build.sh DEPS   programs that the wheel lacks, made of its libraries with g++, to where
# `ros2 run` and launch files look for them: DEPS/jazzy/lib/PACKAGE/PROGRAM
set -euo pipefail

jazzy=$1/jazzy/lib
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

# compiled PACKAGE PROGRAM LIBRARY...
compiled() {
  local folder=$jazzy/$1 program=$2 libraries=()
  shift 2
  for library; do libraries+=("$jazzy/lib$library.so"); done
  mkdir -p "$folder"
  g++ -std=c++17 -O1 -Wall -Wextra -pthread -o "$folder/$program.new" \
    "$here/$program.cpp" "${libraries[@]}" \
    -Wl,-rpath,"$jazzy" -Wl,--allow-shlib-undefined
  mv "$folder/$program.new" "$folder/$program"
}

compiled controller_manager ros2_control_node controller_manager rclcpp rcutils
compiled robot_state_publisher robot_state_publisher robot_state_publisher_node rclcpp rcutils
install -m 755 "$here/spawner.py" "$jazzy/controller_manager/spawner"
