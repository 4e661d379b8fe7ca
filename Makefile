# `make demo` and `make test` are all that a newcomer needs: they make .venv themselves.
VENV ?= .venv
BIN := $(VENV)/bin
# the first Python that is new enough and can make a virtual environment
PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 && echo $$p && break; done)
# `auto` counts cores, and two processors of one core would get one worker
WORKERS ?= logical

.PHONY: help demo test validated lint check docs notebooks format clean
.DEFAULT_GOAL := help

help:
	@echo "make demo       simulate examples/demo/scene.toml and write out/demo.html"
	@echo "make test       run the tests"
	@echo "make validated  write what the tests found into docs/validated_table.md and README.md"
	@echo "make lint       lint, formatting, types"
	@echo "make check      the same, import rule, structure, names"
	@echo "make docs       write the pages of docs/ as out/docs/index.html; a warning is an error"
	@echo "make notebooks  make notebooks/ again from the scripts of examples/, executed"
	@echo "make format     put the formatting right"
	@echo "make clean      remove .venv, out and caches"

$(BIN)/python:
	@test -n "$(PYTHON)" || { echo "vgonio needs Python 3.11 or newer with venv (on Debian: apt install python3-venv)" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

# stamps: the environment is renewed when pyproject.toml is newer than it
$(VENV)/base.stamp: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

$(VENV)/dev.stamp: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[dev]"
	@touch $@ $(VENV)/base.stamp

demo: $(VENV)/base.stamp
	@mkdir -p out
	$(BIN)/vgonio simulate examples/demo/scene.toml -o out/demo.nc --report out/demo.html
	@echo "Done. Open out/demo.html in a browser; the numbers are in out/demo.nc (vgonio.open, xarray)."

# one thread in each worker: the workers together fill the processors; tests/conftest.py says which files come first
test: $(VENV)/dev.stamp
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder

# from out/validated.json, which every run of the tests writes
validated: $(VENV)/dev.stamp
	$(BIN)/python docs/validated.py

lint: $(VENV)/dev.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

check: lint
	$(BIN)/python -m pytest -q tests/test_imports.py tests/test_structure.py tests/test_names.py

docs: $(VENV)/dev.stamp
	$(BIN)/sphinx-build -W --keep-going -n -q -d out/doctrees docs out/docs
	@echo "Done. Open out/docs/index.html in a browser."

notebooks: $(VENV)/dev.stamp
	$(BIN)/python notebooks/make.py

format: $(VENV)/dev.stamp
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf $(VENV) out build dist docs/notebooks *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
