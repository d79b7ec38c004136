#!/usr/bin/env bash
# install_jazzy.sh DEPS   ROS 2 Jazzy out of the PyPI wheel isaacsim-ros2 into DEPS/jazzy
set -euo pipefail

deps=$1
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
python=$deps/venv/bin/python
version=6.2.0.0
sha256=34910c880e452528f5771e0f31673b08703e522f2d09cdb173216be7cd89844f
pip=("$python" -m pip --disable-pip-version-check --no-input)

work=$(mktemp -d "$deps/jazzy.XXXXXX")
trap 'rm -rf "$work"' EXIT

fetch() {
  "${pip[@]}" download --no-deps --no-cache-dir --only-binary :all: -d "$work" \
    "isaacsim-ros2==$version"
  local wheel
  wheel=$(echo "$work"/*.whl)
  echo "$sha256  $wheel" | sha256sum -c -
  "$python" "$here/unpack_jazzy.py" "$wheel" "$work/out"
  rm -rf "$deps/jazzy" "$deps/licences"
  mv "$work/out/licences" "$deps"
  echo "$sha256" >"$work/out/jazzy/wheel.sha256"
  mv "$work/out/jazzy" "$deps"
}
[ "$(cat "$deps/jazzy/wheel.sha256" 2>/dev/null)" = "$sha256" ] || fetch

# the wheel has entry points but no programs, and no `ros2 launch`
cp -r "$here/jazzy_wheel" "$work/programs"
"${pip[@]}" install --no-deps --no-build-isolation --force-reinstall "$work/programs"

# the interpreter's own library, which ROS's extension modules link to
"$python" - "$deps/lib" <<'P'
import pathlib, sys, sysconfig

folder = pathlib.Path(sys.argv[1])
library = pathlib.Path(sysconfig.get_config_var('LIBDIR') or '') / 'libpython3.12.so.1.0'
folder.mkdir(exist_ok=True)
link = folder / library.name
link.unlink(missing_ok=True)
if library.exists():
    link.symlink_to(library)
P
