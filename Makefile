# Needs Python 3.10 or newer with venv, and a package index; no ROS.
#
#   make demo               install into .venv, run driver and detector: some two minutes the first time
#   make view               a live page of a simulated finger, until Ctrl-C: open the address that it prints
#   make grasp              a grasp controller on thirty simulated objects: a table, after some minutes
#   make check              what a change is checked with: lint, types, tests without nodes and benchmarks
#   make benchmark          how fast and how exact it is: the quick form of each measurement
#   make test               all checks
#   make test-matrix        what computes, with NumPy 1.26 and without Numba
#   make fuzz seconds=600   hostile packets, messages, requests, parameters, YAML, recordings and scenes, for so long
#   make test ROS=kilted    the same on the wheels of another distribution, in .venv-kilted
#
# Each step leaves a stamp and is done again only when something it depends on has changed.

PYTHON ?= python3
ROS ?= jazzy

VENV := .venv$(if $(filter-out jazzy,$(ROS)),-$(ROS))
EXTRA := ros$(if $(filter-out jazzy,$(ROS)),-$(ROS))
BIN := $(VENV)/bin
# Ubuntu 24.04's NumPy and SciPy, and a Numba of that time, for the tests of all that computes.
OLDER := .venv-numpy1
CHECKS := build/checks-$(ROS)
COLCON := build/colcon-$(ROS)

SOURCES := $(shell find slip_detector benchmarks examples launch config resource -type f -not -path '*/__pycache__/*')
PACKAGE := $(SOURCES) setup.py setup.cfg pyproject.toml package.xml
TESTS := $(shell find test docs -name '*.py' -o -name '*.md') README.md CONTRIBUTING.md
# What computes, and what of it the chain alone is.
CHAIN_TESTS := test/chain test/evaluation
COMPUTING_TESTS := $(CHAIN_TESTS) test/parameters test/recordings test/sources test/scenes test/tuning \
	test/report test/grasp test/commands

# For how long make fuzz tries, and how many fuzzers share that time.
seconds ?= 600
FUZZERS := $(shell cat test/fuzz/test_*.py | grep -c '^def test_any')

# On all cores; a worker that has nothing left takes tests from another.
PYTEST := -m pytest --numprocesses auto --dist worksteal
# Many tests wait, for a browser, a process or a node: more workers than cores keep the cores busy.
MORE_WORKERS = --numprocesses $$(($$(nproc) * 3 / 2))

# Python keeps what it has compiled: tests start many processes, and pytest compiles each test.
export PYTHONDONTWRITEBYTECODE :=
# The checks' nodes talk among themselves only.
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST

.PHONY: demo grasp view benchmark check test test-matrix fuzz clean
.DELETE_ON_ERROR:

demo: out/demo.json
	@cat out/demo.txt

out/demo.json: $(VENV)/installed $(PACKAGE)
	@mkdir -p out
	@$(BIN)/slip_demo --out out > out/demo.txt

grasp: out/grasp.json
	@cat out/grasp.txt

out/grasp.json: $(VENV)/installed $(PACKAGE)
	@mkdir -p out
	@$(BIN)/slip_grasp --out out > out/grasp.txt

view: $(VENV)/installed
	@echo 'A live page of a simulated finger, which does what you press: rest, slip, taps or press.'
	@$(BIN)/slip_view --scene obedient --folder out/recordings

benchmark: $(VENV)/installed
	@for command in chain scenes extremes paper tune grasp lessons soak view; do \
		echo "python -m benchmarks $$command --quick" && \
		$(BIN)/python -m benchmarks $$command --quick || exit 1; \
	done

check: $(VENV)/installed
	@$(MAKE) --no-print-directory --jobs 3 $(addprefix $(CHECKS)/,lint types core)
	@echo 'Lint, types and all tests without nodes and benchmarks passed.'

# Nodes have the machine to themselves: they keep times.
test: check
	@$(MAKE) --no-print-directory $(CHECKS)/nodes
	@$(MAKE) --no-print-directory $(CHECKS)/benchmarks
	@$(MAKE) --no-print-directory $(CHECKS)/colcon
	@echo 'All checks passed on ROS 2 $(ROS).'

# The same tests beside other libraries: the continuous integration runs them for each change.
test-matrix: $(VENV)/installed
	@$(MAKE) --no-print-directory --jobs 2 $(addprefix $(CHECKS)/,numpy1 interpreted)
	@echo 'What computes passed with NumPy 1.26 and without Numba.'

$(VENV)/installed: setup.py
	@echo 'Installing into $(VENV), only the first time: a minute or two, most of it downloads.'
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --editable '.[bags,numba,tune,$(EXTRA),test]'
	@touch $@

$(OLDER)/installed: setup.py
	@echo 'Installing into $(OLDER), only the first time: a minute or two, most of it downloads.'
	$(PYTHON) -m venv $(OLDER)
	$(OLDER)/bin/python -m pip install --quiet --editable '.[bags,numba,tune]' 'numpy==1.26.*' \
		'scipy==1.11.*' "numba==0.58.*; python_version < '3.12'" \
		"numba==0.59.*; python_version >= '3.12'" hypothesis 'pytest<9' pytest-timeout pytest-xdist
	touch $@

$(CHECKS):
	mkdir -p $@

# There is a worker for each core: threads of NumPy beside them would only wait for each other.
$(CHECKS)/%: export OPENBLAS_NUM_THREADS := 1

$(CHECKS)/lint: $(VENV)/installed $(PACKAGE) $(TESTS) | $(CHECKS)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	touch $@

$(CHECKS)/types: $(VENV)/installed $(PACKAGE) | $(CHECKS)
	$(BIN)/mypy
	touch $@

$(CHECKS)/core: $(VENV)/installed $(PACKAGE) $(TESTS) | $(CHECKS)
	$(BIN)/python $(PYTEST) $(MORE_WORKERS) -m 'not nodes' slip_detector test --ignore test/benchmarks
	touch $@

$(CHECKS)/benchmarks: $(VENV)/installed $(PACKAGE) $(TESTS) | $(CHECKS)
	$(BIN)/python $(PYTEST) benchmarks test/benchmarks
	touch $@

$(CHECKS)/nodes: $(VENV)/installed $(PACKAGE) $(TESTS) | $(CHECKS)
	$(BIN)/python $(PYTEST) $(MORE_WORKERS) -m nodes
	touch $@

# Wheels of NumPy 1.26 end with Python 3.12. What is drawn in a browser is looked at in $(VENV).
$(CHECKS)/numpy1: $(PACKAGE) $(TESTS) | $(CHECKS)
	@if $(PYTHON) -c 'import sys; sys.exit(sys.version_info >= (3, 13))'; then \
		$(MAKE) --no-print-directory $(OLDER)/installed && \
		echo 'All that computes, with NumPy 1.26, SciPy 1.11 and Numba 0.58:' && \
		SLIP_NEED_BROWSER= $(OLDER)/bin/python $(PYTEST) $(COMPUTING_TESTS); \
	else echo 'NumPy 1.26 is left out: it needs Python 3.12 or older.'; fi
	touch $@

$(CHECKS)/interpreted: $(VENV)/installed $(PACKAGE) $(TESTS) | $(CHECKS)
	@echo 'The chain without Numba:'
	PYTHONPATH=test $(BIN)/python $(PYTEST) -p support.without_numba $(CHAIN_TESTS)
	touch $@

# As on a robot: build, test what was built, run the executables from where they were installed.
$(CHECKS)/colcon: $(VENV)/installed $(PACKAGE) $(TESTS) | $(CHECKS)
	rm -rf $(COLCON)
	PATH="$(CURDIR)/$(BIN):$$PATH" .ci/colcon $(COLCON)
	touch $@

# Inputs that nobody would send, for so long: make fuzz seconds=3600.
fuzz: $(VENV)/installed
	@SLIP_FUZZ_SECONDS=$$(($(seconds) / $(FUZZERS))) $(BIN)/python -m pytest --timeout 0 test/fuzz

clean:
	rm -rf build out .venv .venv-* slip_detector.egg-info
