# Two commands are enough: `make demo` and `make test`. Both set everything up first; again, they start at once.
VENV ?= .venv
PYTHON_BIN := $(VENV)/bin/python
DEMO_EPISODES ?= 20
PYTEST_ARGS ?=
export VENV

.DEFAULT_GOAL := help
.PHONY: help setup demo doctor test test-all lint format types bench clean

help:  ## this list
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 10

setup:  ## make the virtual environment (runs before everything else)
	@bash scripts/setup.sh

demo: setup  ## doctor, then 20 held-out episodes with the shipped policy, a table, a report
	@$(PYTHON_BIN) -m tr_grasp demo --episodes $(DEMO_EPISODES)

doctor: setup  ## what this machine lacks, and the cure
	@$(PYTHON_BIN) -m tr_grasp doctor

test: setup  ## all tests but the slow ones
	@$(PYTHON_BIN) -m pytest -m "not slow" $(PYTEST_ARGS)

test-all: setup  ## all tests
	@$(PYTHON_BIN) -m pytest $(PYTEST_ARGS)

lint: setup  ## ruff: rules and format
	@$(PYTHON_BIN) -m ruff check .
	@$(PYTHON_BIN) -m ruff format --check .

format: setup  ## let ruff mend what it can
	@$(PYTHON_BIN) -m ruff check --fix .
	@$(PYTHON_BIN) -m ruff format .

types: setup  ## pyright
	@$(PYTHON_BIN) -m pyright

bench: setup  ## every benchmark, JSON rows on the terminal
	@for script in benchmarks/[a-z]*.py; do \
		module=benchmarks.$$(basename $$script .py); echo "# $$module"; $(PYTHON_BIN) -m $$module || exit 1; \
	done

clean:  ## remove the environment and caches; runs stay
	rm -rf $(VENV) .pytest_cache .ruff_cache .hypothesis build *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
