# One environment, .venv, and what is done in it. `make` tells the targets.
#
# tools/setup.sh makes the environment when there is none that fits; a second run does nothing.

PYTHON := .venv/bin/python
SHELL := /bin/sh

.PHONY: help setup setup-test demo test lint bench bench-ros clean

help:
	@echo 'make setup   an environment in .venv that runs fret_monitor'
	@echo 'make demo    a simulated quadrotor, a monitor and a logger over DDS'
	@echo 'make test    all tests'
	@echo 'make lint    style, types, layers'
	@echo 'make bench   nanoseconds a step, against hand-written C'
	@echo 'make bench-ros  the node as a process, against a bare subscriber in C (ten minutes)'
	@echo 'make clean   remove .venv and what building left'

setup:
	@sh tools/setup.sh run

setup-test:
	@sh tools/setup.sh test

demo: setup
	@$(PYTHON) examples/demo.py

# Two workers, one of which has the tests with ROS 2 for itself.
test: setup-test
	@$(PYTHON) -m pytest -n 2 $(TESTS)

lint: setup-test
	@$(PYTHON) -m pytest --quiet test/test_lint.py test/test_layers.py test/test_house.py

bench: setup
	@$(PYTHON) bench/run.py
	@$(PYTHON) -m bench.peers

# Of its own: it takes minutes in which the machine should do nothing else.
bench-ros: setup
	@$(PYTHON) -m bench.ros

clean:
	rm -rf .venv build install log .mypy_cache .ruff_cache .pytest_cache .hypothesis *.egg-info
