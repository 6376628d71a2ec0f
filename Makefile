# make          set up what is missing, then analyse every mission in raw/
# make test     run the tests
# make lint     check style and types
# make clean    remove results and reports
# make PYTHON=python3.12    with another Python, 3.11 or newer

PYTHON ?= python3
RAW ?= raw
VENV := .venv
PIP := $(VENV)/bin/python -m pip install -qq --disable-pip-version-check --no-compile --constraint constraints.txt

# Modules are compiled when first used, which takes less time than compiling all that is installed.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: run setup test lint clean

run: setup
	@$(VENV)/bin/seatrial run $(RAW)

setup: $(VENV)/.ready

$(VENV)/.ready: pyproject.toml constraints.txt | $(VENV)/bin/python
	@$(VENV)/bin/python -m pip --version >/dev/null 2>&1 || $(VENV)/bin/python -m ensurepip >/dev/null
	@$(PIP) --editable '.[slocum,netcdf]'
	@touch $@

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "make: found $$($(PYTHON) --version 2>&1); expected Python 3.11 or newer; name one: make PYTHON=python3.12" >&2; \
		exit 2; }
	@echo "Setting up $(VENV), once"
	@$(PYTHON) -m venv $(VENV) >/dev/null 2>&1 \
		|| { rm -rf $(VENV); $(PYTHON) -m virtualenv --quiet $(VENV) 2>/dev/null; } \
		|| uv venv --quiet --seed --python $(PYTHON) $(VENV) 2>/dev/null \
		|| { rm -rf $(VENV); \
		echo "make: found no module venv; expected it, virtualenv or uv; on Debian and Ubuntu install python3-venv" >&2; \
		exit 2; }

$(VENV)/.ready-test: $(VENV)/.ready
	@$(PIP) --editable '.[slocum,netcdf,test]'
	@touch $@

test: $(VENV)/.ready-test
	@$(VENV)/bin/python -m pytest --quiet -n auto --maxprocesses 4 --dist loadfile $(ARGS)

lint: $(VENV)/.ready-test
	@$(VENV)/bin/ruff check .
	@$(VENV)/bin/ruff format --check .
	@$(VENV)/bin/mypy

clean:
	@find processed reports -mindepth 1 ! -name README.md -delete
