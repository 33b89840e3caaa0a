# The only commands needed on a machine with Python 3.11 (or newer), pip and gcc: `make demo`, `make test`.

PYTHON ?= $(shell command -v python3.11 || command -v python3 || echo python3)
VENV ?= .venv
PEERS_VENV ?= .venv-peers
# Extra arguments for pytest, e.g. make test PYTEST_ARGS="-k panda"
PYTEST_ARGS ?=
# Processes of pytest; "auto" is one a core
PYTEST_JOBS ?= auto
# Tests of `make without`
WITHOUT ?= $(addprefix tests/,constraints estimation log multibody qp robots/test_bases.py robots/test_couplings_and_locks.py \
	robots/test_dh.py robots/test_limits_and_frames.py robots/test_refused_files.py robots/test_urdf.py symbolic tasks \
	test_validation.py trajectory/test_joint_paths.py)
# Random cases of a test, as a multiple of the usual number
REPEATS ?= 1

BIN := $(VENV)/bin
READY := $(VENV)/.ready
PEERS_READY := $(PEERS_VENV)/.ready
SITE_VENV ?= .venv-site
SITE_READY := $(SITE_VENV)/.ready
TYPES := build/types
PUBLIC := build/public
SOURCES := wbc tasks robots tests bench examples

.DEFAULT_GOAL := help
.PHONY: help setup demo test check without slow lint format types docs site site-setup check-export cross wheel figures bench bench-ik bench-time-laws soak lock platforms clean

help:  ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 18

setup: $(READY)  ## create .venv with the pinned packages and this one

demo: $(READY)  ## a three-armed robot walks along a cylinder at 4 in/s, into runs/walk (the Panda: wbc track demo)
	$(BIN)/wbc walk --out runs/walk --force

test: $(READY)  ## all tests; REPEATS=3 with three times as many random cases; build/failed.txt names those that failed
	WBC_REPEATS=$(REPEATS) $(BIN)/python -m pytest -n $(PYTEST_JOBS) --failed-list=build/failed.txt $(PYTEST_ARGS)

check: $(READY) lint types  ## between edits: lint, types and the tests that are quick
	$(BIN)/python -m pytest -n $(PYTEST_JOBS) -q -m "not slow" $(PYTEST_ARGS)

without: $(READY)  ## a part of the tests in an environment without Pinocchio, Coal, toppra and ruckig; all: WITHOUT=tests
	$(BIN)/python -m tests.without build/without
	build/without/bin/python -m pytest -n $(PYTEST_JOBS) -q -m "not slow" $(WITHOUT) $(PYTEST_ARGS)

slow: $(READY)  ## find the tests that are not quick
	$(BIN)/python -m pytest -n 0 -q --find-slow $(PYTEST_ARGS)

lint: $(READY)  ## ruff: rules and format
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

format: $(READY)  ## apply ruff's fixes and format
	$(BIN)/ruff check --fix-only .
	$(BIN)/ruff format .

# tasks/ and robots/ install as wbc.tasks and wbc.robots; mypy gets the same picture as a tree of links.
types: $(READY)  ## mypy --strict on the package, and on values of handles that are misspelt
	@rm -rf $(TYPES) && mkdir -p $(TYPES)/wbc
	@ln -sf $(CURDIR)/wbc/* $(CURDIR)/tasks $(CURDIR)/robots $(TYPES)/wbc/
	@ln -sf $(CURDIR)/tests/controller/misspelt.py $(TYPES)/
	cd $(TYPES) && $(abspath $(BIN))/mypy --config-file $(CURDIR)/pyproject.toml \
		--cache-dir $(CURDIR)/.mypy_cache --strict -p wbc -m misspelt

docs: $(READY)  ## write what the code declares into the pages of tasks and constraints
	$(BIN)/wbc docs

site-setup: $(SITE_READY)

site: $(SITE_READY)  ## the pages as a site with a reference of all public names, into build/site; warnings are errors
	@rm -rf $(PUBLIC) && mkdir -p $(PUBLIC)/wbc
	@ln -sf $(CURDIR)/wbc/* $(CURDIR)/tasks $(CURDIR)/robots $(PUBLIC)/wbc/
	NO_MKDOCS_2_WARNING=1 $(SITE_VENV)/bin/mkdocs build

cross: $(READY)  ## the code that ticks share compiled by zig for Linux aarch64, macOS arm64 and Windows, and looked at
	$(BIN)/python -m tests.stack.machines

check-export: $(READY)  ## exported C built for aarch64 by zig and run at 1000 states under qemu; says what is not installed
	$(BIN)/python -m tests.export.machines

# PLATFORM is linux-aarch64, macos-arm64 or windows-x86-64, for which ziglang compiles
wheel: $(READY)  ## a wheel with the code that ticks need where there is no compiler, into dist/; PLATFORM=linux-aarch64
	@rm -rf build/lib
	$(BIN)/python -m wbc.stack.ahead
	WBC_WHEEL_PLATFORM=$(PLATFORM) $(BIN)/python -m pip wheel --quiet --no-deps --no-build-isolation --wheel-dir dist .
	@rm -rf build/lib

figures: $(READY)  ## measure again what pages say, where it takes at most 5 minutes and is older than its code
	$(BIN)/python -m bench.figures --stale

bench: $(READY) $(PEERS_READY)  ## compare with pink, mink and placo on the same problems, inverse kinematics, and a quick run of the laws
	$(BIN)/python -m bench --peers-python $(PEERS_VENV)/bin/python
	$(BIN)/python -m bench.ik --full --peers-python $(PEERS_VENV)/bin/python
	$(BIN)/python -m bench.time_laws

bench-ik: $(READY) $(PEERS_READY)  ## inverse kinematics on TRAC-IK's protocol, 10 000 poses a chain; Ctrl-C keeps what it has
	$(BIN)/python -m bench.ik --full --peers-python $(PEERS_VENV)/bin/python

bench-time-laws: $(READY)  ## laws of motion beside raw toppra and raw ruckig, 10^6 states; Ctrl-C keeps what it has
	$(BIN)/python -m bench.time_laws --full

soak: $(READY)  ## random stacks, faults, calls and walks from seeds, minutes; more with REPEATS=30
	WBC_REPEATS=$(if $(filter 1,$(REPEATS)),10,$(REPEATS)) $(BIN)/python -m pytest -n $(PYTEST_JOBS) tests/soak tests/fuzz tests/climb $(PYTEST_ARGS)

platforms: $(READY)  ## which platforms and Pythons have everything that wbc needs as wheels
	$(BIN)/python requirements/platforms.py

lock: $(READY)  ## write the versions in .venv to requirements/lock.txt
	$(BIN)/python requirements/freeze.py > requirements/lock.txt.new
	mv requirements/lock.txt.new requirements/lock.txt

clean:  ## remove environments, builds and caches
	rm -rf $(VENV) $(PEERS_VENV) $(SITE_VENV) build dist runs *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# An environment is ready when everything in it is installed; a change of the pins makes it again in place.
$(READY): requirements/lock.txt pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "Python 3.11 or newer is needed; say which: make PYTHON=/path/to/python3.11"; exit 1; }
	$(call make_venv,$(VENV))
	$(BIN)/python -m pip install --quiet --no-deps --requirement requirements/lock.txt
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	@touch $@

$(PEERS_READY): requirements/peers.txt
	$(call make_venv,$(PEERS_VENV))
	$(PEERS_VENV)/bin/python -m pip install --quiet --no-deps --requirement requirements/peers.txt
	@touch $@

$(SITE_READY): requirements/site.txt
	$(call make_venv,$(SITE_VENV))
	$(SITE_VENV)/bin/python -m pip install --quiet --no-deps --requirement requirements/site.txt
	@touch $@

# Debian splits ensurepip off from Python; then pip is brought in by the pip outside.
define make_venv
	@test -x $(1)/bin/python && $(1)/bin/python -m pip --version > /dev/null 2>&1 \
		|| { echo "creating $(1) with $(PYTHON)"; rm -rf $(1); $(PYTHON) -m venv $(1) 2> /dev/null; } \
		|| { rm -rf $(1) && $(PYTHON) -m venv --without-pip $(1) \
			&& $(PYTHON) -m pip --python $(1)/bin/python install --quiet pip; }
endef
