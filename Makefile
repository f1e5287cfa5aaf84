# make run: the main job on the embedded sample. make test: the tests. Every target sets up what it
# needs in .venv, from nothing but Python, its module venv and make.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
LOG := $(VENV)/install.log
PIP := $(BIN)/python -m pip --disable-pip-version-check install --constraint constraints.txt
# Modules become bytecode when they are imported, where that is kept: most of the 10 000 never are.
LAZY = $(shell $(BIN)/python -c 'import sys; print("" if sys.dont_write_bytecode else "--no-compile")' 2>/dev/null)
# The suite's cost needs what the suite needs.
BENCHMARKS := $(filter-out benchmarks/suite_cost.py,$(wildcard benchmarks/*.py))
comma := ,

.PHONY: run test test-lstm test-verify install lint bench docs clean-venv
.DEFAULT_GOAL := run
# Also under -j: kernels are compiled by what was installed before.
.NOTPARALLEL:

run: install
	$(BIN)/besman run pipelines/ur5_stick_throw.yaml

install: $(VENV)/.installed $(VENV)/.kernels

test: $(VENV)/.test $(VENV)/.kernels
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile

# What `make test` skips because torch is large: with its requirements 0.9 GB where pip finds a build
# for the CPU; the usual wheel cannot be imported without its CUDA libraries, several GB more.
test-lstm: $(VENV)/.lstm
	$(BIN)/python -m pytest tests/classifiers tests/stages/recognize tests/evaluation/test_recognition.py -k "lstm or torch"

# What `make test` skips because Drake's wheel is large, and asks for Mosek's, which is proprietary.
test-verify: $(VENV)/.verify
	$(BIN)/python -m pytest tests/simulation/second_engine tests/pipeline/test_verified_run.py

lint: $(VENV)/.lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(VENV)/.bench $(VENV)/.kernels
	for script in $(BENCHMARKS); do $(BIN)/python $$script || exit 1; done

# Warnings are errors. The pages are in docs/_build/html and need no network.
docs: $(VENV)/.docs $(VENV)/.kernels
	$(BIN)/sphinx-build --builder html --fail-on-warning --keep-going --quiet \
		--doctree-dir docs/_build/doctrees docs docs/_build/html

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "besman needs Python 3.11 or newer; say which with: make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -m venv $(VENV) || \
		{ rm -rf $(VENV); echo "no venv module: install python3-venv, or say make PYTHON=..."; exit 1; }

# $(call install,EXTRAS,WHAT,HOW LONG) goes with a stamp. All that pip says is in the log. Pinocchio's
# wheel expects GCC's OpenMP on the machine: where there is none it gets the one in scikit-learn's.
define install
	@echo "installing $(2) into $(VENV): $(3); log: $(LOG)"
	@$(PIP) $(LAZY) --editable ".$(if $(1),[$(1)])" >>$(LOG) 2>&1 || \
		{ tail -n 15 $(LOG); echo "pip failed: all that it said is in $(LOG)"; exit 1; }
	@$(BIN)/python -c 'import ctypes; ctypes.CDLL("libgomp.so.1")' 2>/dev/null || \
		{ cd $(VENV)/lib/python3*/site-packages/cmeel.prefix/lib && \
		ln -sf ../../scikit_learn.libs/libgomp-*.so* libgomp.so.1; }
	@touch $@ $(VENV)/.installed
endef

# What has no wheels is built: without compilers its tests are skipped, and say so.
ORACLE = $(shell command -v cc >/dev/null && command -v c++ >/dev/null && \
	$(BIN)/python -c 'import pathlib, sysconfig as s; pathlib.Path(s.get_path("include"), "Python.h").stat()' \
	2>/dev/null && echo ,oracle)
NO_ORACLE = @$(if $(ORACLE),,echo "no cc and c++ with Python.h: tests of what has no wheel are skipped")

$(VENV)/.installed $(VENV)/.test $(VENV)/.lstm $(VENV)/.verify $(VENV)/.lint $(VENV)/.docs $(VENV)/.bench: \
	pyproject.toml constraints.txt | $(VENV)/bin/python

$(VENV)/.installed:
	$(call install,,90 packages (1.5 GB),about a minute)

$(VENV)/.test:
	$(NO_ORACLE)
	$(call install,test$(ORACLE),170 packages (2.4 GB on disk),one or two minutes)

$(VENV)/.lstm:
	$(call install,test$(comma)lstm,torch and 170 packages (3.1 GB),three minutes)

$(VENV)/.verify:
	$(call install,test$(comma)verify,Drake and 170 packages (2.7 GB),two or three minutes)

$(VENV)/.lint:
	$(call install,lint,95 packages (1.6 GB),about a minute)

$(VENV)/.docs:
	$(call install,docs,110 packages (1.5 GB),about a minute)

$(VENV)/.bench:
	$(NO_ORACLE)
	$(call install,bench$(ORACLE),130 packages (1.8 GB),one or two minutes)

# Numba sees that a kernel's own file has changed, not that of a kernel which it calls.
KERNELS := $(shell grep -lr --include='*.py' -e njit -e @compiled besman)

$(VENV)/.kernels: pyproject.toml constraints.txt $(KERNELS)
	@find besman -name '*.nb[ic]' -delete
	@echo "compiling kernels, once: about a quarter of a minute on two cores"
	@$(BIN)/python -m besman.pipeline.compile_kernels
	@touch $@

clean-venv:
	rm -rf $(VENV)
