# Needs Python 3.11 to 3.13 with venv, and make. Everything else is installed into .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
PACKAGES := contracts geo retrieval index survey workers coordinator

.PHONY: demo test check faults bench clean

demo: $(STAMP)  ## Render a small town, index it, locate old photos of it
	$(BIN)/flaneur demo --out demo-out

test: $(STAMP)  ## Run all tests
	$(BIN)/python -m pytest --numprocesses auto --maxprocesses 4 --dist loadfile

check: $(STAMP)  ## What CI runs: format, lint, types, import direction, tests
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(MAKE) test

faults: $(STAMP)  ## Throw faults at running jobs: each in each stage, then 100 random schedules
	$(BIN)/python -m pytest tests/faults --faults

bench: $(STAMP)  ## Figures on real images (FLANEUR_TEST_DATA), by hand
	$(BIN)/python -m benchmarks

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13) and "Flaneur needs Python 3.11 to 3.13, this is " + sys.version.split()[0] + ". Try: make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	touch $(STAMP)

clean:
	rm -rf $(VENV) demo-out build dist
