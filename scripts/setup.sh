#!/usr/bin/env bash
# Install what the project needs under .deps/. Safe to repeat, quick when nothing changed.
#
#   scripts/setup.sh run      what the package, its nodes and the demo need
#   scripts/setup.sh          that, and what the tests need: torch, a browser, tools
#
#   PYTHON312            the Python 3.12 to use (else it is searched for)
#   LIP_ID_ROS_JAZZY     folder of an installed ROS 2 Jazzy (else /opt/ros/jazzy, else the wheel)
#   LIP_ID_ROS_OFFLINE   set to anything: do without ROS
#
# Why it is done this way: docs/explanation/decisions.md
set -euo pipefail

case ${1:-all} in
  run) tests='' ;;
  all) tests=yes ;;
  *) printf 'setup: expected run or nothing, got %s\n' "$1" >&2 && exit 2 ;;
esac
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
deps=$root/.deps
log=$deps/setup.log
started=$SECONDS
# what a caller's ROS or virtual environment would mix in
unset PYTHONPATH PYTHONHOME VIRTUAL_ENV AMENT_PREFIX_PATH COLCON_PREFIX_PATH CMAKE_PREFIX_PATH

say() { printf 'setup: %s\n' "$*"; }

fail() {
  printf 'setup: %s\n' "$*" >&2
  exit 1
}

# attempt WHAT REMEDY COMMAND...   run quietly; on failure show how the log ends, then the remedy
attempt() {
  local what=$1 remedy=$2
  shift 2
  printf '\n== %s: %s\n' "$(date -u +%FT%TZ)" "$*" >>"$log"
  if ! "$@" >>"$log" 2>&1; then
    grep -v 'WARNING: Location' "$log" | tail -n 15 >&2
    fail "$what failed (the whole log: $log). $remedy"
  fi
}

# current WHAT TEXT   whether .deps/WHAT was finished before, from the very things that TEXT names
current() { [ -e "$deps/$1" ] && [ -f "$deps/$1.stamp" ] && [ "$(cat "$deps/$1.stamp")" = "$2" ]; }

finished() { printf '%s' "$2" >"$deps/$1.stamp"; }

digest() { cat "$@" | cksum | tr ' ' '-'; }

# --- which ROS and which Python -----------------------------------------------------------------

# sets ros (folder of an installation, 'wheel' or '') and without (the reason for '')
choose_ros() {
  ros='' without=''
  if [ -n "${LIP_ID_ROS_OFFLINE:-}" ]; then
    without='LIP_ID_ROS_OFFLINE is set; unset it to have ROS'
  elif [ -n "${LIP_ID_ROS_JAZZY:-}" ]; then
    [ -f "$LIP_ID_ROS_JAZZY/setup.bash" ] || fail "LIP_ID_ROS_JAZZY names $LIP_ID_ROS_JAZZY," \
      'which has no setup.bash; name the folder of an installed ROS 2 Jazzy, or unset it'
    ros=$LIP_ID_ROS_JAZZY
  elif [ -f /opt/ros/jazzy/setup.bash ]; then
    ros=/opt/ros/jazzy
  elif wheel_fits; then
    ros=wheel
  else
    without="the only ROS 2 Jazzy on PyPI is for Linux on x86_64 with glibc 2.35 or newer, and \
there is none in /opt/ros/jazzy; install Jazzy (docs.ros.org) and set LIP_ID_ROS_JAZZY to its folder"
  fi
}

wheel_fits() {
  [ "$(uname -sm)" = 'Linux x86_64' ] || return 1
  local glibc
  glibc=$(getconf GNU_LIBC_VERSION 2>/dev/null | cut -d ' ' -f 2)
  [ -n "$glibc" ] && [ "$(printf '%s\n' 2.35 "$glibc" | sort -V | head -n 1)" = 2.35 ]
}

# sets python; without a Python 3.12 there is no ROS either
choose_python() {
  local wanted='v == (3, 12)'
  [ "$ros" != wheel ] || wanted='v == (3, 12) and shared()'
  if [ -n "$ros" ]; then
    python=$(scripts/find_python.sh "$wanted") && return
    ros='' without='no Python 3.12 that runs and has venv and its shared library was found; '
    without+='install it (Ubuntu 24.04: apt install python3.12 python3.12-venv libpython3.12) '
    without+='or set PYTHON312 to it'
  fi
  python=$(scripts/find_python.sh 'v >= (3, 11)') ||
    fail 'no Python 3.11 or newer with venv was found; install one, or set PYTHON312 to it'
}

# --- the steps ----------------------------------------------------------------------------------

# the packages of a requirements file into the virtual environment
install() {
  attempt 'installing Python packages' 'Check the network and the disk, then repeat make setup.' \
    "$deps/venv/bin/python" -m pip install --disable-pip-version-check --no-input -r "$1"
}

install_packages() {
  local requirements=requirements-offline.txt
  [ -z "$ros" ] || requirements=requirements-lock.txt
  local stamp
  stamp="$python $root $(digest "$requirements")"
  current venv "$stamp" && return
  say "Python packages of $requirements into .deps/venv (1.3 GB; to watch: tail -f .deps/setup.log)"
  rm -f "$deps/venv.stamp"
  if ! same_python; then
    rm -rf "$deps/tests" "$deps/jazzy.stamp"
    attempt 'making the virtual environment' 'Remove .deps and try again.' \
      "$python" -m venv --clear "$deps/venv"
  fi
  install "$requirements"
  finished venv "$stamp"
}

install_test_packages() {
  [ -n "$tests" ] || return 0
  local requirements=requirements-offline-test.txt size='a few hundred MB, and torch'
  [ -z "$ros" ] || requirements=requirements-test-lock.txt size='6 GB, most of it for torch'
  local stamp
  stamp="$(cat "$deps/venv.stamp") $(digest "$requirements")"
  current tests "$stamp" && return
  say "Python packages of $requirements ($size); some minutes the first time"
  rm -rf "$deps/tests"
  install "$requirements"
  touch "$deps/tests"
  finished tests "$stamp"
}

# an environment of the lower bounds of setup.py; without a Python 3.11 its test is skipped
install_lowest() {
  local oldest stamp
  [ -n "$tests" ] && oldest=$(scripts/find_python.sh 'v == (3, 11)') || return 0
  stamp="$oldest $(digest requirements-lowest.txt)"
  current lowest "$stamp" && return
  say 'the lowest versions of requirements-lowest.txt into .deps/lowest (0.5 GB)'
  attempt 'making the environment of lowest versions' 'Remove .deps/lowest and try again.' \
    "$oldest" -m venv --clear "$deps/lowest"
  attempt 'installing the lowest versions' 'Check the network and the disk, then try again.' \
    "$deps/lowest/bin/python" -m pip install --disable-pip-version-check --no-input \
    --only-binary :all: -r requirements-lowest.txt
  finished lowest "$stamp"
}

# the environment of `make docs`; its packages are for Python 3.12
install_docs() {
  [ -n "$tests" ] && [ -n "$ros" ] || return 0
  current docs "$(cat "$deps/venv.stamp") $(cksum <requirements-docs.txt)" && return
  say 'Python packages of requirements-docs.txt into .deps/docs (0.2 GB)'
  attempt 'installing the tools of make docs' 'Check the network and the disk, then try again.' \
    scripts/docs_env.sh
}

# whether the environment stands, was made here and from the chosen Python
same_python() {
  [ -x "$deps/venv/bin/pip" ] && head -n 1 "$deps/venv/bin/pip" | grep -qF "$deps/venv/" &&
    [ "$("$deps/venv/bin/python" -c 'import os, sys; print(os.path.realpath(sys.executable))')" = \
      "$python" ]
}

install_jazzy() {
  [ "$ros" = wheel ] || return 0
  local stamp
  stamp="$(cat "$deps/venv.stamp") $(digest scripts/*jazzy.* scripts/jazzy_wheel/*)"
  current jazzy "$stamp" && return
  say 'ROS 2 Jazzy from the PyPI wheel isaacsim-ros2 (130 MB). It is under the NVIDIA Omniverse'
  say 'License Agreement, not under ours; its text is kept in .deps/licences'
  attempt 'installing ROS 2 Jazzy' 'Check the network and repeat make setup, or do without ROS: \
LIP_ID_ROS_OFFLINE=1 make test' scripts/install_jazzy.sh "$deps"
  finished jazzy "$stamp"
}

# programs that the wheel lacks; without a compiler the tests that need them are skipped
build_programs() {
  [ "$ros" = wheel ] || return 0
  if ! command -v g++ >/dev/null; then
    say 'without g++ there are no ros2_control_node and robot_state_publisher; their tests are skipped'
    return
  fi
  local stamp
  stamp="$(cat "$deps/jazzy.stamp") $(g++ -dumpfullversion) $(digest scripts/jazzy_programs/*)"
  current jazzy/lib/controller_manager/ros2_control_node "$stamp" && return
  say 'ros2_control_node and robot_state_publisher, from libraries of Jazzy'
  attempt 'compiling programs of ROS' 'Mend what the log names, then repeat make setup.' \
    scripts/jazzy_programs/build.sh "$deps"
  finished jazzy/lib/controller_manager/ros2_control_node "$stamp"
}

# links to the sources are enough: only what lists or names files needs a new build
build() {
  local stamp
  stamp="$ros $(cat "$deps/venv.stamp") $(digest setup.py setup.cfg package.xml \
    <(find config launch resource -type f 2>/dev/null | sort))"
  current build "$stamp" && return
  say 'the package lip_id_ros'
  if [ -n "$ros" ]; then
    attempt 'building the package' 'Mend what the log names, then repeat make setup.' \
      scripts/build.sh
  else
    attempt 'installing the package' 'Mend what the log names, then repeat make setup.' \
      "$deps/venv/bin/python" -m pip install --disable-pip-version-check --no-input \
      --no-deps --no-build-isolation -e .
    mkdir -p "$deps/build"
  fi
  finished build "$stamp"
}

# compile what a first fit needs beside what follows; who needs it first compiles it anyway
precompile() {
  local stamp
  stamp="$(cat "$deps/venv.stamp") $(find lip_id_ros -name '*.py' | sort | xargs cat | cksum)"
  current precompile.log "$stamp" && return
  {
    if command -v flock >/dev/null; then flock -n 8 || exit 0; fi  # one at a time
    current precompile.log "$stamp" && exit 0  # another has ended since
    if PYTHONPATH=$root OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 nice -n 10 \
      "$deps/venv/bin/python" scripts/precompile.py >"$deps/precompile.log" 2>&1; then
      finished precompile.log "$stamp"
    fi
  } 8>"$deps/precompile.lock" 9>&- </dev/null >/dev/null 2>&1 &  # without the lock, and no pipe
}

tell() {
  local programs=lip_id
  if [ -n "$ros" ]; then
    programs='lip_id and ros2'
    rm -f "$deps/without_ros"
  else
    printf 'without ROS 2 (nodes, launch files and their tests are left out): %s\n' "$without" \
      >"$deps/without_ros"
    say "$(cat "$deps/without_ros")"
  fi
  say "ready after $((SECONDS - started)) s: . scripts/env.sh puts $programs on the path"
}

mkdir -p "$deps"
touch "$deps/COLCON_IGNORE"
# one at a time
if command -v flock >/dev/null; then
  exec 9>"$deps/lock"
  flock 9
fi
choose_ros
choose_python
install_packages
precompile
install_jazzy
build_programs
printf '%s\n' "$ros" >"$deps/ros"
build
install_test_packages
install_lowest
install_docs
tell
