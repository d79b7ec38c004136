#!/usr/bin/env bash
# The environment of `make docs`, .deps/docs: packages of its own, and after them those of the
# project. Run by scripts/docs.sh and scripts/setup.sh; quick when nothing changed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
tools=.deps/docs
python=.deps/venv/bin/python
packages='import sysconfig; print(sysconfig.get_path("purelib"))'
stamp="$(cat .deps/venv.stamp) $(cksum <requirements-docs.txt)"
[ "$(cat "$tools.stamp" 2>/dev/null)" != "$stamp" ] || exit 0
rm -rf "$tools" "$tools.stamp"
"$python" -m venv --without-pip "$tools"
"$python" -m pip --python "$tools/bin/python" install --disable-pip-version-check --no-input \
  -r requirements-docs.txt
{ "$python" -c "$packages"; pwd; } >"$tools/project"
mv "$tools/project" "$("$tools/bin/python" -c "$packages")/project.pth"
printf '%s' "$stamp" >"$tools.stamp"
