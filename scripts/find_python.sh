#!/usr/bin/env bash
# find_python.sh CONDITION...   print the first Python that really runs and meets the conditions
#
# CONDITION is a Python expression over `v` (the version as a tuple) and `shared()` (whether a
# program can load the interpreter's shared library, as ROS's extension modules do). A name on the
# path proves nothing: a pyenv shim is found and fails, and Debian ships venv separately.
set -euo pipefail

pyenv=${PYENV_ROOT:-${HOME:-/root}/.pyenv}/versions
probe='
import ctypes, ensurepip, os, sys, sysconfig, venv

v = sys.version_info[:2]


def shared():
    name = f"libpython{v[0]}.{v[1]}.so.1.0"
    for path in (os.path.join(sysconfig.get_config_var("LIBDIR") or "", name), name):
        try:
            ctypes.CDLL(path)
            return True
        except OSError:
            pass
    return False


if not all(eval(condition) for condition in sys.argv[1:]):
    sys.exit(1)
print(os.path.realpath(sys.executable))
'

for candidate in "${PYTHON312:-}" python3.12 python3 {/usr,/usr/local}/bin/python3.{12,13,11} \
  "$pyenv"/3.12*/bin/python3.12 "$pyenv"/3.1[13]*/bin/python3; do
  if [ -n "$candidate" ] && "$candidate" -I -c "$probe" "$@" 2>/dev/null; then
    exit 0
  fi
done
exit 1
