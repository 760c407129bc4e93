# Builds, checks and runs homing_node on a machine without ROS: Linux on x86-64 with
# python3 >= 3.10 (with venv), g++ and make. Everything is installed into .venv (ROS 2 Jazzy), and
# for `make test-kilted` into .venv-kilted (ROS 2 Kilted).

PYTHON ?= python3
VENV := .venv
KILTED := .venv-kilted
# Of the environment that the target of a rule lies in.
PIP = $(@D)/bin/python -m pip install --quiet --quiet --disable-pip-version-check
# The tests that start the node, and those of the modules that import ROS. Left out are those of
# faults and losses: they take minutes, and ask nothing of ROS that the others do not ask.
TESTS_OF_ROS := $(addprefix test/test_,$(addsuffix .py, client config inputs messages middleware \
  node_action node_homing node_launch node_life node_services node_sim_time \
  reports serialized services setpoints timebase))
INTERFACES := $(shell find interfaces -type f)

# ROS ships no types: mypy looks at all but the package that uses it, and the client.
TYPED := $(filter-out homing_node/ros/% homing_node/client.py, \
  $(wildcard homing_node/*.py homing_node/*/*.py homing_node/*/*/*.py))

# What looks at a clock goes to one worker; the rest gives way to it (test/conftest.py).
WORKERS := --numprocesses auto --maxprocesses 4 --no-loadscope-reorder

# A ROS installation that happens to be sourced must not leak into .venv.
unexport PYTHONPATH AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON
# Where Python may not keep what it has compiled, each of hundreds of processes compiles it again.
unexport PYTHONDONTWRITEBYTECODE
# Processes that are started here neither hear nor disturb ROS nodes of other machines.
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST

.PHONY: help venv demo demo-gantry lint test test-long test-kilted test-faults fuzz bench bench-accuracy bench-cells docs workspace \
  clean
.DELETE_ON_ERROR:

help:
	@echo 'make venv    install everything into $(VENV) (the first time: two minutes)'
	@echo 'make demo    home simulated axes and show what happens; make demo-gantry: a gantry'
	@echo 'make test    lint, then run all tests'
	@echo 'make test-long   run the tests that take long, and those of docs and benchmarks'
	@echo 'make test-kilted   run the tests of the node on ROS 2 Kilted, in $(KILTED)'
	@echo 'make lint    ruff (rules and format), and mypy --strict on all that needs no ROS'
	@echo 'make test-faults   run every fault scenario, print what became of it'
	@echo 'make fuzz    random geometries and random messages, for long (half an hour)'
	@echo 'make bench   measure how fast it is (ten minutes); make bench-accuracy: how exact'
	@echo 'make bench-cells   lines of 4, 8 and 16 cells: processor, memory, age of states (seven minutes)'
	@echo 'make docs    make the generated pages of doc/ again'
	@echo 'make workspace DIR=~/ws/src   link both packages side by side, as colcon finds them'
	@echo 'make clean   remove $(VENV), $(KILTED) and everything generated'
	@echo 'PYTHON=python3.12 make venv   use another interpreter'

demo: venv $(VENV)/.for_tests_control_msgs
	@$(VENV)/bin/python scripts/demo.py

demo-gantry: venv
	@$(VENV)/bin/python scripts/demo_gantry.py

lint: venv
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check --quiet .
	$(VENV)/bin/mypy $(TYPED)

test: lint $(VENV)/.test_interfaces
	ROS_PYTHON_CHECK_FIELDS=1 $(VENV)/bin/python -m pytest $(WORKERS) $(MORE) -m 'not long'

test-long: venv $(VENV)/.test_interfaces
	ROS_PYTHON_CHECK_FIELDS=1 $(VENV)/bin/python -m pytest $(WORKERS) $(MORE) -m long

test-kilted: $(KILTED)/.package
	ROS_PYTHON_CHECK_FIELDS=1 $(KILTED)/bin/python -m pytest $(WORKERS) $(MORE) -m 'not long' $(TESTS_OF_ROS)

test-faults: venv
	@$(VENV)/bin/python scripts/faults.py
	ROS_PYTHON_CHECK_FIELDS=1 $(VENV)/bin/python -m pytest -q test/test_faults.py \
	  test/test_node_faults.py

fuzz: venv
	HOMING_FUZZ=1 $(VENV)/bin/python -m pytest -q test/test_invariants.py test/test_edge_fuzz.py \
	  test/test_node_faults.py::test_any_messages_in_any_order \
	  test/test_node_life.py::test_homings_in_a_row

bench: venv $(VENV)/.test_interfaces
	@$(VENV)/bin/python bench

bench-accuracy: venv
	@$(VENV)/bin/python bench accuracy

bench-cells: venv
	@$(VENV)/bin/python bench cells

docs: venv
	$(VENV)/bin/python scripts/docs.py
	$(VENV)/bin/python scripts/methods.py
	$(VENV)/bin/python scripts/reference.py
	$(VENV)/bin/python scripts/edges.py
	$(VENV)/bin/python scripts/gantry.py
	$(VENV)/bin/python scripts/faults.py --write

workspace:
	@test -n '$(DIR)' || { echo 'usage: make workspace DIR=~/ws/src' >&2; exit 1; }
	@$(PYTHON) scripts/workspace.py '$(DIR)'

clean:
	rm -rf $(VENV) $(KILTED) build install log *.egg-info
	rm -rf .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The environments, in four steps; each is repeated only when its inputs changed.
venv: $(VENV)/.package

$(VENV)/.created $(KILTED)/.created:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' \
	  || { echo 'homing_node needs Python 3.10 or newer, as $(PYTHON)' >&2; exit 1; }
	@command -v $${CXX:-c++} >/dev/null \
	  || { echo 'homing_node needs a C++ compiler: apt install g++' >&2; exit 1; }
	@echo '[1/4] creating $(@D)'
	@$(PYTHON) -m venv --clear $(@D)
	@touch $@

$(VENV)/.requirements: $(VENV)/.created requirements.txt requirements-dev.txt
	@echo '[2/4] installing ROS 2 Jazzy and the other requirements'
	@$(PIP) --requirement requirements-dev.txt
	@touch $@

$(VENV)/.interfaces: $(VENV)/.requirements $(INTERFACES)
	@echo '[3/4] building homing_interfaces (about a minute)'
	@$(PIP) --no-deps --force-reinstall ./interfaces/homing_interfaces
	@touch $@

# Kilted's pins and build list are made from those of Jazzy.
$(KILTED)/.requirements: $(KILTED)/.created requirements.txt requirements-dev.txt scripts/kilted.py
	@echo '[2/4] installing ROS 2 Kilted and the other requirements'
	@$(PYTHON) scripts/kilted.py $(@D)/from_jazzy
	@$(PIP) --requirement $(@D)/from_jazzy/requirements-dev.txt
	@touch $@

$(KILTED)/.interfaces: $(KILTED)/.requirements $(INTERFACES)
	@echo '[3/4] building homing_interfaces (about a minute)'
	@$(PYTHON) scripts/kilted.py $(@D)/from_jazzy
	@$(PIP) --no-deps --force-reinstall ./$(@D)/from_jazzy/homing_interfaces
	@touch $@

# Editable: the sources are used where they are, and launch/ and config/ too.
%/.package: %/.interfaces setup.py setup.cfg pyproject.toml
	@echo '[4/4] installing homing_node'
	@$(PIP) --no-deps --editable .
	@touch $@

# Messages of ros2_control with the same names and layouts, for tests only; each package is built
# again only when it has changed.
FOR_TESTS := $(patsubst interfaces_for_tests/%/package.xml,%,$(wildcard interfaces_for_tests/*/package.xml))

$(VENV)/.test_interfaces: $(FOR_TESTS:%=$(VENV)/.for_tests_%)
	@touch $@

.SECONDEXPANSION:
$(VENV)/.for_tests_%: $(VENV)/.interfaces $$(shell find interfaces_for_tests/$$* -type f)
	@echo 'building $* for the tests (about a minute)'
	@$(PIP) --no-deps --force-reinstall ./interfaces_for_tests/$*
	@touch $@
