# Two commands do everything: `make demo` and `make test`. Each sets up what it needs in .venv first.
# PYTHON chooses the interpreter (3.11 or newer): make demo PYTHON=python3.12
# What is installed, and in which version, is in uv.lock; `make lock` renews it.

VENV := .venv
BIN := $(VENV)/bin
PY := $(BIN)/python
UV := $(BIN)/uv
UV_VERSION := 0.13.9
# As locked, with the interpreter of .venv; what else was installed there stays.
SYNC := UV_PROJECT_ENVIRONMENT=$(VENV) $(UV) sync --quiet --frozen --inexact --python $(PY)
export OPENBLAS_NUM_THREADS := 1
# Three for each core, since many tests wait for what a bench does at its own pace; from 4 to 8.
WORKERS := $(PY) -c "import os; print(min(8, max(4, 3 * os.cpu_count())))"
# The tests start hundreds of programs: each would compile the sources anew.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
FIRMWARE ?= python
.PHONY: help firmware demo test long-tests recipes notebooks lint check bench campaign site generate wheel cold paper lock setup setup-test format clean

help:  ## list the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1\t/' | expand -t 18

demo: $(VENV)/.installed  ## the main job on a simulated bench: arm, steps, sinusoid, table, run log, page
	@$(BIN)/smad demo $(FIRMWARE:%=--firmware %)

firmware: $(VENV)/.installed  ## compile the firmware's ports; the image to flash is build/firmware/smad-mega.hex
	@$(PY) -m sim_device.firmware.build

test: $(VENV)/.test-installed  ## the tests but those of campaigns; says how long they took the last time
	@cat $(VENV)/.test-took 2>/dev/null || echo "the time that they take is kept for the next run"
	@began=$$(date +%s); $(PY) -m pytest -n $$($(WORKERS)) --dist worksteal && \
	  echo "all passed; the last run took $$(( ($$(date +%s) - began + 59) / 60 )) min" | tee $(VENV)/.test-took

long-tests: $(VENV)/.test-installed  ## the tests of campaigns, which make test leaves out
	@$(PY) -m pytest -n 2 -m campaign

recipes: $(VENV)/.test-installed  ## every step of docs/architecture.md's recipes left out once: something must complain
	@$(PY) -m pytest -n 2 -m campaign tests/recipes

notebooks: $(VENV)/.test-installed  ## run every notebook of examples/, the slow ones too
	@SMAD_ALL_NOTEBOOKS=1 $(PY) -m pytest tests/docs/test_notebooks.py

lint: $(VENV)/.test-installed  ## lint, format, types, generated files
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(PY) tools/generate.py --check

check: lint  ## lint, and the tests of import directions
	@$(PY) -m pytest -q tests/test_contracts.py

bench: $(VENV)/.test-installed  ## the numbers: speed as ratios within one run
	@$(PY) -m bench $(BENCH)

campaign: $(VENV)/.test-installed  ## faults, soak, hostile clients, fuzzing: make campaign CAMPAIGN="faults --seed 7"
	@$(PY) -m campaign $(or $(CAMPAIGN),--help)

site: $(VENV)/.site-installed  ## the pages of docs/ as a site, in build/site
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict

generate: $(VENV)/.test-installed  ## write every generated file anew
	@$(PY) tools/generate.py

format: $(VENV)/.test-installed  ## format the code
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

wheel: $(VENV)/.test-installed  ## build the wheel: dist/smad-*.whl
	@$(UV) build --quiet --wheel --python $(PY)

cold: wheel  ## run the demo from the wheel with nothing installed, on every supported Python here
	@$(PY) -m bench.cold_start dist/smad-*.whl

paper: $(VENV)/.installed  ## draw the figures of paper/paper.md
	@$(PY) paper/figures.py

lock: $(VENV)/.python  ## renew uv.lock: the newest versions that fit pyproject.toml
	@$(UV) lock --upgrade --python $(PY)

setup: $(VENV)/.installed  ## install smad into .venv
setup-test: $(VENV)/.test-installed  ## install smad and what its tests need

$(VENV)/.python:
	@tools/venv $(VENV) $(PYTHON)
	@$(PY) -m pip install -qq --disable-pip-version-check uv==$(UV_VERSION)
	@touch $@

# What is installed and what is compiled are targets of their own: `make -j2 setup-test` compiles
# the physics while it installs the rest.
$(VENV)/.packages: pyproject.toml uv.lock $(VENV)/.python
	@echo "installing smad into $(VENV) (a minute or two the first time)"
	@$(SYNC) --extra all
	@touch $@

$(VENV)/.installed: $(VENV)/.packages $(wildcard sim_device/plant/kernel/*.py) smad/fmi/library.py smad/fmi/to_c.py \
  $(wildcard firmware_protocol/supervisor/*.py) firmware_protocol/enums.py firmware_protocol/shared_library.py
	@echo "compiling the physics kernel and the board's supervisor (once)"
	@$(PY) -m smad.fmi.library
	@$(PY) -m firmware_protocol.supervisor.compiled
	@$(PY) -m sim_device.plant.warm
	@touch $@

$(VENV)/.test-packages: $(VENV)/.packages
	@echo "installing what the tests need"
	@$(SYNC) --extra test
	@touch $@

# Collecting imports every source of the tests and of the packages, which each of the workers would
# else compile for itself.
$(VENV)/.test-compiled: $(VENV)/.test-packages
	@echo "compiling what the tests share (once)"
	@$(PY) -m tests.warm
	@$(PY) -m pytest -qq --collect-only >/dev/null
	@touch $@

$(VENV)/.test-installed: $(VENV)/.installed $(VENV)/.test-compiled
	@touch $@

$(VENV)/.site-installed: $(VENV)/.packages
	@test -e $(VENV)/.test-packages || $(SYNC) --extra all --extra site
	@touch $@

clean:  ## remove what the build made (not your runs)
	rm -rf $(VENV) sim_device/plant/kernel/kernel.so firmware_protocol/c/supervisor.so build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
