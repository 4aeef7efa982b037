# One environment, .venv, and what is done in it. `make` tells the targets.
#
# tools/setup.sh makes the environment when there is none that fits; a second run does nothing.

PYTHON := .venv/bin/python
SHELL := /bin/sh

.PHONY: help setup setup-test demo test lint bench bench-ros soak fuzz coverage prove clean

help:
	@echo 'make setup   an environment in .venv that runs fret_monitor'
	@echo 'make demo    a simulated quadrotor, a monitor and a logger over DDS'
	@echo 'make test    all tests'
	@echo 'make lint    style, types, layers'
	@echo 'make bench   nanoseconds a step, against hand-written C'
	@echo 'make bench-ros  the node as a process, against a bare subscriber in C; a quarter of an hour'
	@echo 'make soak    ten million messages through the node, and rows through simulate; as long'
	@echo 'make fuzz    hostile inputs for SECONDS=60 (docs/assurance.md)'
	@echo 'make coverage  what of the package and of csrc the tests run'
	@echo 'make prove   proofs of the bundles in config/, and mutants of their C (docs/prove.md)'
	@echo 'make clean   remove .venv and what building left'

setup:
	@sh tools/setup.sh run

setup-test:
	@sh tools/setup.sh test

demo: setup
	@$(PYTHON) examples/demo.py

# Three workers, two of which begin with the tests with ROS 2: these wait more than they work.
test: setup-test
	@$(PYTHON) -m pytest -n 3 $(TESTS)

lint: setup-test
	@$(PYTHON) -m pytest --quiet test/test_lint.py test/test_layers.py test/test_house.py

bench: setup
	@$(PYTHON) bench/run.py
	@$(PYTHON) -m bench.peers

# Of its own: it takes minutes in which the machine should do nothing else.
bench-ros: setup
	@$(PYTHON) -m bench.ros

soak: setup
	@$(PYTHON) -m bench.soak

prove: setup-test
	@$(PYTHON) -m bench.proofs
	@$(PYTHON) -m bench.mutants

# With atheris, guided by coverage; where it cannot be installed, by what is refused and why.
SECONDS := 60
fuzz: setup-test
	@$(PYTHON) -c 'import atheris' 2>/dev/null || $(PYTHON) -m pip install --quiet \
	  --disable-pip-version-check 'atheris>=3,<4' || echo 'fret_monitor: fuzzing without atheris'
	@PYTHONPATH=.:test $(PYTHON) -m fuzz.run --seconds $(SECONDS) $(TARGETS)

# The package by coverage.py, csrc by gcc and gcov; TESTS as for `make test`.
coverage: setup-test
	@$(PYTHON) tools/measure_coverage.py $(TESTS)

clean:
	rm -rf .venv build install log .mypy_cache .ruff_cache .pytest_cache .hypothesis
	rm -rf .coverage fuzz-crashes *.egg-info
