# `make run` and `make test` each do all their own set-up. PYTHON must be 3.11 or newer.
PYTHON ?= $(shell test -x /usr/bin/python3 && /usr/bin/python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' && echo /usr/bin/python3 || echo python3)
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: run test lint types layers check setup clean
setup: $(STAMP)

$(STAMP): pyproject.toml tools/install-debian-packages
	tools/install-debian-packages
	$(PYTHON) -m venv --system-site-packages $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet -e '.[dev,ur,abb,genicam]'
	touch $@

run: $(STAMP)
	$(BIN)/cell run --dry-run

test: $(STAMP) lint types layers
	tools/install-mrcal
	$(BIN)/python -m pytest -n 2

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(STAMP)
	$(BIN)/mypy

layers: $(STAMP)
	$(BIN)/lint-imports

clean:
	rm -rf $(VENV)
