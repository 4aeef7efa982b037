# All targets run in one environment, .venv. `make` lists them.
#
# tools/setup.sh makes the environment if there is none that fits; a second run does nothing.

PYTHON := .venv/bin/python
SHELL := /bin/sh

.PHONY: help setup setup-test demo demo-gate test kilted thorough lint bench bench-ros bench-bags bench-copilot bench-analysis soak fuzz coverage prove mutants clean

help:
	@echo 'make setup   make .venv, an environment that runs fret_monitor'
	@echo 'make demo    a simulated quadrotor, a monitor and a logger over DDS'
	@echo 'make demo-gate  a vehicle that runs into a wall, and with a gate does not'
	@echo 'make test    the tests, without the longest'
	@echo 'make thorough  all tests, with many more random examples; kilted; mutants (hours)'
	@echo 'make kilted  the tests with ROS 2, on the wheels of ROS 2 Kilted'
	@echo 'make lint    style, types, layers'
	@echo 'make bench   nanoseconds a step, beside hand-written C'
	@echo 'make bench-ros  the node as a process, beside a subscriber in C (20 minutes)'
	@echo 'make bench-copilot  the C of export --to copilot, beside Copilot itself'
	@echo 'make bench-bags  checking recordings, beside reading them'
	@echo 'make bench-analysis  analyze, and what the traces of tests notice (10 minutes)'
	@echo 'make soak    ten million messages through the node, and rows through simulate (15 minutes)'
	@echo 'make fuzz    hostile inputs for SECONDS=60 (docs/assurance.md)'
	@echo 'make coverage  lines of the package and of csrc that the tests run'
	@echo 'make prove   prove the bundles in config/, and kill mutants of their C (docs/prove.md)'
	@echo 'make mutants  change csrc and the package in one place each, and run the tests (hours)'
	@echo 'make clean   remove .venv and build products'

setup:
	@sh tools/setup.sh run

setup-test:
	@sh tools/setup.sh test

demo: setup
	@$(PYTHON) examples/demo.py

demo-gate: setup
	@$(PYTHON) examples/wall.py

# Six workers; four of them start with the tests with ROS 2, which wait more than they compute.
test: setup-test
	@$(PYTHON) -m pytest -n 6 $(TESTS)

# The tests with ROS 2 on the wheels of Kilted, in an environment of their own.
kilted:
	@sh tools/setup.sh kilted
	@.venv-kilted/bin/python -m pytest -n 4 $(or $(TESTS),test/ros)

# Many more random examples of those tests that leave their number to hypothesis.
# Where rtamt, reelay and confseq (PyPI) are installed, they are compared with, too; -rs names them.
thorough: setup-test
	@FRET_MONITOR_EXAMPLES=500 $(PYTHON) -m pytest -n 4 -rs $(TESTS)
	@$(if $(TESTS),:,$(MAKE) --no-print-directory kilted mutants)

lint: setup-test
	@$(PYTHON) -m pytest --quiet test/test_lint.py test/test_layers.py test/test_house.py

bench: setup
	@$(PYTHON) bench/run.py
	@$(PYTHON) -m bench.timed
	@$(PYTHON) -m bench.windows
	@$(PYTHON) -m bench.instances
	@$(PYTHON) -m bench.peers

# Not part of `bench`: takes 20 minutes on an otherwise idle machine.
bench-ros: setup
	@$(PYTHON) -m bench.ros
	@$(PYTHON) -m bench.graph

bench-bags: setup-test
	@$(PYTHON) -m bench.bags
	@$(PYTHON) -m bench.tables

bench-copilot: setup
	@$(PYTHON) -m bench.copilot_abi

# FRET is a folder with exports of FRET projects, such as its case studies.
FRET := $(wildcard ../shared/data/fret/exports)
bench-analysis: setup-test
	@PYTHONPATH=.:test $(PYTHON) -m bench.analysis $(FRET)

soak: setup
	@$(PYTHON) -m bench.soak

prove: setup-test
	@$(PYTHON) -m bench.proofs
	@$(PYTHON) -m bench.mutants

# Goes on where it was stopped; ROOMS is a part, such as csrc (bench/mutation.py).
mutants: setup-test
	@nice -n 15 $(PYTHON) -m bench.mutation $(ROOMS)

# Guided by coverage with atheris; where it cannot be installed, by the error messages.
SECONDS := 60
fuzz: setup-test
	@$(PYTHON) -c 'import atheris' 2>/dev/null || $(PYTHON) -m pip install --quiet \
	  --disable-pip-version-check 'atheris>=3,<4' || echo 'fret_monitor: fuzzing without atheris'
	@PYTHONPATH=.:test $(PYTHON) -m fuzz.run --seconds $(SECONDS) $(TARGETS)

# coverage.py for the package, gcc and gcov for csrc; TESTS as for `make test`.
coverage: setup-test
	@$(PYTHON) tools/measure_coverage.py $(TESTS)

clean:
	rm -rf .venv .venv-kilted build install log .mypy_cache .ruff_cache .pytest_cache .hypothesis
	rm -rf .coverage fuzz-crashes *.egg-info
