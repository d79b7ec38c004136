#!/usr/bin/env bash
# docs.sh [DIR]: the site from docs/, into DIR or docs/_build/html. Tutorials are run, the reference
# comes from docstrings, and any warning is an error.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
. scripts/env.sh
scripts/docs_env.sh >.deps/docs.log 2>&1 || {
  tail -n 15 .deps/docs.log >&2
  echo 'docs: installing requirements-docs.txt needs Python 3.12 and a network (.deps/docs.log)' >&2
  exit 1
}
export MPLBACKEND=agg  # Jupyter's own is not installed beside lip_id
exec .deps/docs/bin/python -m sphinx --fail-on-warning --keep-going --quiet docs "${1:-docs/_build/html}"
