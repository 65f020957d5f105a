# The front door. `make demo` and `make test` do all their own set-up.

SHELL := /bin/bash
PYTHON ?= python3
ARGS ?=
SEEDS ?= 1
# as the executables have it (damadics_fd/start.py)
export OPENBLAS_NUM_THREADS ?= 1
ENV := source ./env.sh
BUILT := ros2_ws/install/.built
COMPILED := ros2_ws/install/.compiled
READERS := tools/npm/node_modules/.package-lock.json
FOREIGN := tests/connect/foreign/node_modules/.package-lock.json
SOURCES := $(shell find ros2_ws/src -type f -not -name '*.pyc' -not -path '*/__pycache__/*' \
	-not -path '*/test/*' -not -path '*/.pytest_cache/*')

.PHONY: help demo demo-plant dashboard test test-random coverage report campaign-monitor build env lint types docs lock soak attack licences clean fuzz

help: ## show what can be made
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 18

demo: $(BUILT) ## the paper's two experiments through the running nodes: table, figures, bags
	@$(ENV) && ros2 run damadics_bringup demo --out bags/demo $(ARGS)

dashboard: $(BUILT) ## a simulated valve and the web page at http://127.0.0.1:8080
	@$(ENV) && ros2 run damadics_bringup run --simulate --dashboard $(ARGS)

demo-plant: $(BUILT) ## a simulated plant behind OPC UA: a fault, and who hears of it when
	@$(ENV) && ros2 run damadics_bringup demo_plant $(ARGS)

test: $(COMPILED) $(READERS) $(FOREIGN) ## run all tests
	@$(ENV) && tools/test.sh $(ARGS)

coverage: $(BUILT) ## branch coverage of core and bag, 90 % at least: short records as plain Python (minutes)
	@$(ENV) && NUMBA_DISABLE_JIT=1 python -m pytest -q -m plain --timeout=600 --cov --cov-fail-under=90 \
		--cov-report=term-missing $(ARGS) ros2_ws/src/damadics_fd/test && python tools/left_out.py

test-random: $(COMPILED) $(READERS) ## tests in random order, those of nodes file by file (again: ARGS=--random-order-seed=N)
	@$(ENV) && python -m pytest -m 'not slow and not ros' -o pythonpath=tests --random-order-bucket=global $(ARGS)
	@$(ENV) && python -m pytest -m 'not slow and ros' -o pythonpath=tests --random-order-bucket=module $(ARGS)

report: $(BUILT) ## the benchmark's 44 scenarios x all detectors: docs/results/ (minutes; more: SEEDS=20)
	@$(ENV) && ros2 run damadics_evaluate evaluate run --out results/campaign --first-seed 1000 --seeds $(SEEDS) --no-report \
		&& ros2 run damadics_evaluate evaluate paper results/campaign \
		&& ros2 run damadics_evaluate evaluate report results/campaign --to docs/results

campaign-monitor: $(BUILT) ## false alarms, delays, masking, sample rates of mode monitor (an hour)
	@$(ENV) && python -m damadics_evaluate.campaigns.monitor $(ARGS)

build: $(COMPILED) ## set up .venv and build the ROS 2 workspace

env: ## set up .venv only
	@$(PYTHON) tools/setup_env.py

$(BUILT): $(SOURCES) tools/build.sh tools/setup_env.py $(wildcard tools/requirements/*.txt)
	@$(PYTHON) tools/setup_env.py
	@tools/build.sh

$(COMPILED): $(BUILT) # what the demo can do without
	@$(ENV) && python tools/compile_kernels.py more && touch $@

$(READERS): tools/npm/package-lock.json
	@if command -v npm > /dev/null; then \
		echo 'Setting up the readers of Foxglove and Lichtblick ...'; npm ci --silent --prefix tools/npm; \
	else echo 'npm is not installed: bags are not checked with the readers of Foxglove'; fi

$(FOREIGN): tests/connect/foreign/package-lock.json
	@if command -v npm > /dev/null; then \
		echo 'Setting up a second OPC UA stack ...'; npm ci --silent --prefix tests/connect/foreign; \
	else echo 'npm is not installed: our OPC UA server is not read with node-opcua'; fi

fuzz: $(BUILT) ## 6000 mutations of bags by a new seed (another: FUZZ_SEED=1 FUZZ_COUNT=100)
	@$(ENV) && python -m pytest -s -m slow -k thousands_of_mutations \
		ros2_ws/src/damadics_fd/test/bag/test_fuzz.py

lint: $(BUILT) ## check style and types
	@$(ENV) && ruff check . && ruff format --check .
	@$(MAKE) --no-print-directory types

types: $(BUILT)
	@$(ENV) && mypy

docs: $(BUILT) ## the documentation with the API pages: docs/_build/index.html
	@$(ENV) && python -m uv pip install --quiet --require-hashes -r tools/requirements/docs.txt \
		-c tools/requirements/constraints.txt \
		&& sphinx-build -q -W --keep-going docs docs/_build && echo docs/_build/index.html

lock: ## pin every package with its hashes, after a change of tools/requirements
	@.venv/bin/python tools/lock.py

soak: $(BUILT) ## two valves, page and recorder for hours: memory, false alarms, samples (90 min; less: ARGS)
	@$(ENV) && python tools/soak.py $(ARGS)

attack: $(BUILT) ## damaged state files, odd requests, killed nodes: what is lost? (hours; less: ARGS)
	@$(ENV) && python tools/attack.py $(ARGS)

licences: $(BUILT) ## the licence of every installed package
	@$(ENV) && python tools/licences.py

clean: ## remove everything that was built
	rm -rf .venv docs/_build tools/npm/node_modules tests/connect/foreign/node_modules ros2_ws/build ros2_ws/install ros2_ws/log
