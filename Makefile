# `make demo` and `make test` set up a virtual environment of their own and need nothing but Python 3.11 or later.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
TORCH ?= torch
# The versions that the tests ran with; `make CONSTRAINTS= test` takes what is newest.
CONSTRAINTS ?= -c constraints.txt
# Processes for the tests: one a core; a browser and a scheduler have processes of their own, so never more than four.
# Each takes a stretch of the tests, so that what a file sets up is set up once, and then what others have left.
WORKERS ?= $(shell n=$$(nproc 2>/dev/null || echo 2); echo $$((n < 2 ? 2 : n > 4 ? 4 : n)))

.PHONY: demo test tests test-long lint bench docs clean

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip

# torch first and by its version in constraints.txt: a plain `torch` may bring gigabytes of CUDA libraries.
$(VENV)/.run-ready: pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet $(CONSTRAINTS) $(TORCH)
	$(BIN)/python -m pip install --quiet $(CONSTRAINTS) --editable .
	touch $@

$(VENV)/.test-ready: pyproject.toml tests/peers.txt $(VENV)/.run-ready
	$(BIN)/python -m pip install --quiet $(CONSTRAINTS) --editable '.[test]'
	$(BIN)/python -m pip install --quiet --no-deps -r tests/peers.txt || echo 'without peers: tests beside them skip'
	touch $@

demo: $(VENV)/.run-ready
	OMP_NUM_THREADS=1 $(BIN)/python data/demo.py

lint: $(VENV)/.test-ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	MYPYPATH=data $(BIN)/mypy data/*.py
	$(BIN)/lint-imports

# Beside each other: types are checked on one core, and take as long as a tenth of the tests.
test: $(VENV)/.test-ready
	@$(MAKE) --no-print-directory -j 2 lint tests

# Tests of the studio need a Chromium; where none can be had they are skipped and say so.
tests: $(VENV)/.test-ready
	@command -v chromium >/dev/null || { [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null && \
		{ apt-get update -qq; apt-get install -y -qq chromium; } >/dev/null 2>&1; } || true
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal

# What would take `make test` beyond ten minutes: more machines of kinds that it asks anyway.
test-long: $(VENV)/.test-ready
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n $(WORKERS) -m long

bench: $(VENV)/.test-ready
	$(BIN)/python -m pytest benchmarks --benchmark-enable --benchmark-only

docs: $(VENV)/.run-ready
	$(BIN)/python docs/make/effects.py
	$(BIN)/python docs/make/api.py
	$(BIN)/python docs/make/library.py
	$(BIN)/python docs/make/tutorial.py

clean:
	rm -rf $(VENV) build *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
