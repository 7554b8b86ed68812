# `make run` and `make test` each do all their own set-up. PYTHON must be 3.11 or newer.
PYTHON ?= $(shell test -x /usr/bin/python3 && /usr/bin/python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' && echo /usr/bin/python3 || echo python3)
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: help run test lint types layers docs setup clean
setup: $(STAMP)  ## install into .venv

help:  ## this list
	@sed -n 's/^\([a-z]*\):.*## /\1\t/p' $(MAKEFILE_LIST)

$(STAMP): pyproject.toml tools/install-debian-packages
	tools/install-debian-packages
	$(PYTHON) -m venv --system-site-packages $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet -e '.[dev,ur,abb,genicam,study]'
	touch $@

run: $(STAMP)  ## the paper's larger cell, simulated, with its report
	$(BIN)/cell run --dry-run

test: $(STAMP) lint types layers docs  ## lint, types, layers, docs and every test
	tools/install-debian-packages test
	tools/install-mrcal
	$(BIN)/python -m pytest -n 2

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
