SHELL := /bin/bash
ENV := . scripts/env.sh &&
# more arguments for the tool behind a target: make test ARGS='-k bags'
ARGS ?=
# one worker more than cores, since tests of nodes wait; a worker needs 2 GB of memory.
# nproc obeys OMP_NUM_THREADS, which is about threads and not about cores
WORKERS ?= -n $(shell expr $$(env -u OMP_NUM_THREADS nproc) + 1) --maxprocesses 5 --dist loadgroup \
  --no-loadscope-reorder
# where it is set, each of the many processes would compile all that it imports anew
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup setup-run demo docs test test-fast check mutants bench clean distclean

help:
	@echo 'make demo       simulated arm: record, fit, serve, compare with the truth (demo_output/)'
	@echo 'make test       all tests that this machine can run'
	@echo 'make test-fast  the tests that take neither long nor ROS'
	@echo 'make check      format, lint, types, direction of imports'
	@echo 'make mutants    deliberate bugs that the tests must catch; takes long'
	@echo 'make docs       the site: tutorials are run, any warning is an error (docs/_build/html)'
	@echo 'make bench      how fast and how accurate'
	@echo 'make setup      install what all of them need under .deps/ (each does so by itself)'
	@echo 'make setup-run  install what the package and the demo need: without torch and test tools'
	@echo 'make clean      remove build products and outputs; keep what was fetched'
	@echo 'make distclean  remove .deps/ too'

setup:
	@scripts/setup.sh

setup-run:
	@scripts/setup.sh run

demo: setup-run
	@scripts/run_demo.sh $(ARGS)

docs: setup-run
	@scripts/docs.sh

test: setup
	@$(ENV) python -m pytest $(WORKERS) $(ARGS)

test-fast: setup
	@$(ENV) python -m pytest $(WORKERS) -m 'not slow and not ros' $(ARGS)

check: setup
	@$(ENV) ruff format --check . && ruff check . && mypy && python -m pytest -q test/test_imports.py

mutants: setup
	@$(ENV) python scripts/mutants.py $(ARGS)

bench: setup
	@$(ENV) python -m benchmarks $(ARGS)

clean:
	rm -rf .deps/build .deps/install .deps/log .deps/build.stamp demo_output docs/_build *.egg-info
	rm -rf .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -path ./.deps -prune -o -name __pycache__ -type d -print0 | xargs -0 rm -rf

distclean: clean
	rm -rf .deps
