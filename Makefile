# `make run` and `make test` each do all their own set-up. PYTHON must be 3.11 or newer.
PYTHON ?= $(shell test -x /usr/bin/python3 && /usr/bin/python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' && echo /usr/bin/python3 || echo python3)
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
# No picture is rendered, no arm driven, no page opened, no whole recording diagnosed
FAST := tests/chain/test_projection.py tests/chain/test_rigid.py tests/chain/test_evaluation.py tests/kinematics \
  tests/paper tests/solver/test_free_poses.py tests/cell/test_files.py tests/cell/test_recording.py \
  tests/cell/test_session.py tests/cell/test_worker.py tests/docs/test_architecture.py
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: help run demo-discovery test test-fast lint types layers docs setup clean
setup: $(STAMP)  ## install into .venv

help:  ## this list
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST)

$(STAMP): pyproject.toml tools/install-debian-packages
	tools/install-debian-packages
	$(PYTHON) -m venv --system-site-packages $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet -e '.[dev,ur,abb,genicam,ros,study]'
	touch $@

run: $(STAMP)  ## the paper's larger cell, simulated, with its report
	$(BIN)/cell run --dry-run

demo-discovery: $(STAMP)  ## physics that no catalogue has, found as a law and predicted
	$(BIN)/python -m benchmarks.discovery.demo

test: $(STAMP) lint types layers docs  ## lint, types, layers, docs and every test
	tools/install-debian-packages test
	tools/install-mrcal
	$(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder

test-fast: $(STAMP) lint types layers  ## lint, types, layers, and the tests that take a moment
	$(BIN)/python -m pytest -n 2 $(FAST)

lint: $(STAMP)  ## ruff, its rules and its format
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(STAMP)  ## mypy, strict
	$(BIN)/mypy

layers: $(STAMP)  ## which package may import which
	$(BIN)/lint-imports

docs: $(STAMP)  ## build/docs, every link and anchor checked
	$(BIN)/mkdocs build --strict --config-file tools/mkdocs.yml

clean:  ## remove .venv
	rm -rf $(VENV)
