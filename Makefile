# make run: the main job on the embedded sample. make test: the tests. Both set up what they need.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check

.PHONY: run test test-lstm install lint bench docs clean-venv
.DEFAULT_GOAL := run

run: install
	$(BIN)/besman run pipelines/ur5_stick_throw.yaml

test: $(VENV)/.test
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile

# What `make test` skips because torch is large: with its requirements 0.9 GB where pip finds a build
# for the CPU; the usual wheel cannot be imported without its CUDA libraries, several GB more.
test-lstm: $(VENV)/.lstm
	$(BIN)/python -m pytest tests/recognition tests/evaluation/test_recognition.py -k "lstm or torch"

install: $(VENV)/.installed

lint: $(VENV)/.test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(VENV)/.test
	for script in benchmarks/*.py; do $(BIN)/python $$script || exit 1; done

# Warnings are errors. The pages are in docs/_build/html and need no network.
docs: $(VENV)/.docs
	$(BIN)/sphinx-build --builder html --fail-on-warning --keep-going --quiet \
		--doctree-dir docs/_build/doctrees docs docs/_build/html

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "besman needs Python 3.11 or newer; say which with: make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -m venv $(VENV) || \
		{ rm -rf $(VENV); echo "no venv module: install python3-venv, or say make PYTHON=..."; exit 1; }

$(VENV)/.installed: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(PIP) install --quiet --constraint constraints.txt --editable .
	@echo "compiling kernels, once"
	$(BIN)/python -m besman.pipeline.compile_kernels
	@touch $@

# movement-primitives is built from source: without a C compiler its tests are skipped, and say so.
$(VENV)/.test: $(VENV)/.installed
	$(PIP) install --quiet --constraint constraints.txt --editable ".[test]"
	@if command -v cc >/dev/null; then \
		$(PIP) install --quiet --constraint constraints.txt --editable ".[test,oracle]"; \
	else echo "no C compiler: the tests against movement-primitives are skipped"; fi
	@touch $@

$(VENV)/.lstm: $(VENV)/.test
	$(PIP) install --quiet --constraint constraints.txt --editable ".[test,lstm]"
	@touch $@

$(VENV)/.docs: $(VENV)/.installed
	$(PIP) install --quiet --constraint constraints.txt --editable ".[docs]"
	@touch $@

clean-venv:
	rm -rf $(VENV)
