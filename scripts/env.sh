# shellcheck shell=bash
# Put lip_id, ros2 and the built package on the path, in bash or zsh, any number of times:
#
#   . scripts/env.sh

if [ -n "${BASH_VERSION:-}" ]; then
  _lip_deps=${BASH_SOURCE[0]}
elif [ -n "${ZSH_VERSION:-}" ]; then
  eval '_lip_deps=${(%):-%x}'
else
  echo 'env.sh: source it from bash or zsh' >&2
  return 1
fi
_lip_deps=$(cd "$(dirname "$_lip_deps")/.." >/dev/null && pwd)/.deps

# _lip_first VARIABLE FOLDER   put the folder first, unless it is in the list already
_lip_first() {
  _lip_value=
  eval "_lip_value=\${$1:-}"
  case ":$_lip_value:" in
    *":$2:"*) ;;
    *) export "$1=$2${_lip_value:+:$_lip_value}" ;;
  esac
}

# the same role as /opt/ros/jazzy/setup.bash, for the Jazzy of the PyPI wheel
_lip_wheel() {
  _lip_first LD_LIBRARY_PATH "$_lip_deps/lib"
  _lip_first LD_LIBRARY_PATH "$_lip_deps/jazzy/lib"
  _lip_first PYTHONPATH "$_lip_deps/jazzy/rclpy"
  _lip_first AMENT_PREFIX_PATH "$_lip_deps/jazzy"
  export ROS_DISTRO=jazzy ROS_VERSION=2 ROS_PYTHON_VERSION=3
  export RMW_IMPLEMENTATION="${RMW_IMPLEMENTATION:-rmw_fastrtps_cpp}"
  export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
}

# an installation's own set-up script, which does not bear `set -u`
_lip_installed() {
  case $- in *u*) _lip_nounset=1 ;; *) _lip_nounset= ;; esac
  set +u
  if [ -n "${ZSH_VERSION:-}" ]; then . "$1/setup.zsh"; else . "$1/setup.bash"; fi
  [ -z "$_lip_nounset" ] || set -u
  unset _lip_nounset
}

_lip_environment() {
  if [ ! -f "$_lip_deps/ros" ]; then
    echo 'env.sh: nothing is set up yet; run make setup first' >&2
    return 1
  fi
  _lip_ros=$(cat "$_lip_deps/ros")
  case $_lip_ros in
    '') ;;
    wheel) _lip_wheel ;;
    *) _lip_installed "$_lip_ros" ;;
  esac
  if [ -n "$_lip_ros" ]; then
    _lip_first AMENT_PREFIX_PATH "$_lip_deps/install/lip_id_ros"
    _lip_first PYTHONPATH "$_lip_deps/build/lip_id_ros"
  fi
  _lip_first PATH "$_lip_deps/venv/bin"
  # ROS writes its logs under HOME; some services and containers have none
  [ -n "${HOME:-}" ] || export ROS_LOG_DIR="${ROS_LOG_DIR:-$_lip_deps/log/ros}"
}

if _lip_environment; then _lip_status=0; else _lip_status=1; fi
unset -f _lip_first _lip_wheel _lip_installed _lip_environment
unset _lip_deps _lip_value _lip_ros
eval "unset _lip_status; return $_lip_status"
