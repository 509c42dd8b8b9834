# `make` lists the targets. Each prepares what it needs first; the second time that takes a moment.

SHELL := /bin/bash
PYTHON := .venv/bin/python
PYTEST_ARGS ?=
# A file's tests stay together, since they share what they set up. PYTEST_ARGS="-n 0" runs all in one process.
PYTEST = $(PYTHON) -m pytest --numprocesses logical --dist loadfile
BENCH_ARGS ?=
# PIP_COMPILE_ARGS=--upgrade moves every package to its newest release.
PIP_COMPILE_ARGS ?=

.DEFAULT_GOAL := help
.PHONY: help setup setup-dev serve test test-all bench check format openapi lock clean

help: ## list the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

setup:
	@scripts/setup.sh

setup-dev:
	@scripts/setup.sh --dev

serve: export HALFLIGHT_DATA_DIR ?= $(or $(XDG_STATE_HOME),$(HOME)/.local/state)/halflight
serve: setup ## serve on 127.0.0.1:8000, or on HOST and PORT; sessions are kept in HALFLIGHT_DATA_DIR
	@exec .venv/bin/halflight serve

test: setup-dev ## run the tests, but for the slow ones (PYTEST_ARGS="-k name")
	$(PYTEST) $(PYTEST_ARGS)

test-all: setup-dev ## run all tests
	$(PYTEST) -m "slow or not slow" $(PYTEST_ARGS)

bench: setup ## report speed against error into out/report (BENCH_ARGS="--full", "--help")
	@$(PYTHON) -m benchmarks $(BENCH_ARGS)

check: setup-dev ## lint, format, types and layers, without the tests
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	$(PYTHON) -m mypy
	.venv/bin/lint-imports

format: setup-dev ## put the code in its format, and repair what lint can
	.venv/bin/ruff check --fix
	.venv/bin/ruff format

openapi: setup ## write openapi/openapi.json anew from the code
	$(PYTHON) -m service.openapi

COMPILE = .venv/bin/pip-compile --quiet --generate-hashes --allow-unsafe --strip-extras --no-header \
	--no-emit-index-url --no-emit-find-links --no-emit-trusted-host --no-emit-options \
	--build-deps-for editable $(PIP_COMPILE_ARGS)

lock: setup-dev ## lock the dependencies of pyproject.toml (PIP_COMPILE_ARGS=--upgrade)
	$(COMPILE) --output-file requirements/run.lock pyproject.toml
	$(COMPILE) --extra dev --constraint requirements/run.lock --output-file requirements/dev.lock pyproject.toml
	rm -rf halflight.egg-info

clean: ## remove what runs and set-up leave behind, .venv too
	rm -rf .venv build dist out *.egg-info .hypothesis .import_linter_cache .mypy_cache .pytest_cache \
		.ruff_cache .schemathesis
	find . -name __pycache__ -not -path './.git/*' -prune -exec rm -rf {} +
