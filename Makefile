# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
# Set-up, simulation and tests from a fresh clone; `make` alone lists the targets.

PYTHON ?= python3
DISTRO ?= jazzy

# ROS 2 as wheels, one set for each distribution; `make lock` pins what they need.
WHEELS_jazzy := 'ros-rclpy[fastrtps]==7.1.6' 'ros-common-interfaces==5.3.6'
WHEELS_kilted := 'ros-rclpy[fastrtps]==9.1.2' 'ros-common-interfaces==5.5.1'

# A sourced ROS 2 takes the place of the wheels.
SOURCED := $(if $(ROS_DISTRO),$(shell $(PYTHON) -c 'import rclpy' 2>/dev/null && echo $(ROS_DISTRO)))

# The stamp's name says what the environment was made of, so another choice makes another one.
VENV := .venv
BIN := $(VENV)/bin
BASE := $(VENV)/.made-of-$(if $(SOURCED),sourced-$(SOURCED),wheels-$(DISTRO))-$(subst /,_,$(PYTHON))
# So does that of the sources: git, copies and editors put files in place that are older than an
# installation, remove some, or write one while it is under way.
SOURCES := $(VENV)/.sources-$(firstword $(shell find dsse_ros msg_adapters config launch resource rviz scripts viewers \
	package.xml pyproject.toml setup.py -name __pycache__ -prune -o -type f -exec sha256sum {} + | LC_ALL=C sort | sha256sum))
# Errors only; Python compiles what it imports, a small part of what is installed.
PIP_INSTALL := $(BIN)/python -m pip --disable-pip-version-check -qq install --no-compile

# Most tests with nodes wait for one another's processes, so that four at once keep two cores busy.
# The tests of a file share their nodes; the files come in the order of test/conftest.py.
WITH_NODES := --numprocesses=4 --dist=loadfile --no-loadscope-reorder
# The others wait for nothing, and each further worker collects all of them again.
WITHOUT_NODES := --numprocesses=logical --maxprocesses=4 --dist=worksteal

# Nothing but what is in a file, by its hashes.
LOCKED := --no-deps --require-hashes --requirement
COMMA := ,
OF_TESTS := viz,area,geotiff,gis,movie,onnx,test,sitl,routes,record,dashboard,browser,docs,viewer,campaign,drift,grib,zarr,land,ray,compat,tak

# What calls the libraries that have lower bounds.
TESTS_OF_OLDEST := $(addprefix test/world/scenario/test_,actions.py geodesy.py scenario.py) test/picture/test_rendering.py \
	$(addprefix test/search/environments/test_,conformance.py oracles.py) \
	test/planners/test_planners.py \
	$(addprefix test/msg_adapters/test_,occupancy.py poses.py) \
	$(addprefix test/vehicles/mavlink/test_,codec.py messages.py) test/vehicles/control/test_item_messages.py

# What needs PyTorch: RLlib, TorchRL, Stable-Baselines3.
TESTS_OF_LEARNING := test/training test/compat/test_libraries.py

# Folders of tests without DDS; those marked slow are left out of them.
TESTS_OF_CHECK := $(addprefix test/,base compat conformance mission msg_adapters packaging picture planners results ros/runtime screens search \
	training vehicles world)

# Commands and their refusals come over DDS.
TESTS_OF_COVERAGE := $(addprefix test/,base cli compat conformance mission/run mission/files mission/vehicles mission/recording msg_adapters \
	picture planners ros/runtime search vehicles/control vehicles/fleet vehicles/mavlink vehicles/mission_items world \
	$(addprefix ros/nodes/test_,bad_input.py lost_drones.py step_modes.py))

MISSION = $(if $(SCENARIO),--scenario '$(SCENARIO)') $(if $(RULES),--rules '$(RULES)') $(if $(PLANNER),--planner '$(PLANNER)') $(if $(MODEL),--model '$(MODEL)') \
	$(if $(NUM_DRONES),--num-drones '$(NUM_DRONES)') $(if $(SEED),--seed '$(SEED)') $(if $(OUT),--out '$(OUT)')
# Movies as MP4 and two of the planners need more than the others.
OF_SIM := viz,area,record$(if $(VIEW),$(COMMA)dashboard)$(if $(filter %.mp4 %.MP4,$(MOVIE)),$(COMMA)movie)$(if \
	$(filter onnx,$(PLANNER)),$(COMMA)onnx)$(if $(filter route,$(PLANNER)),$(COMMA)routes)
SIM := $(VENV)/.sim-$(subst $(COMMA),-,$(OF_SIM))
RATE_OF = $(if $(RATE),--rate '$(RATE)')
MOVIE_OF = $(if $(MOVIE),--movie '$(MOVIE)')
PLAN_OF = $(if $(PLAN),--plan '$(PLAN)')

export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
export AMENT_PREFIX_PATH := $(CURDIR)/$(VENV)$(if $(AMENT_PREFIX_PATH),:$(AMENT_PREFIX_PATH))
# Containers often keep Python from keeping what it compiles: every node would start a second later.
unexport PYTHONDONTWRITEBYTECODE
# Left over from another environment of wheels, it would keep ours from finding its libraries.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE
# The wheels have Fast DDS only.
ifeq ($(SOURCED),)
unexport RMW_IMPLEMENTATION
endif

# Make ignores variables that it does not know: the help of the targets lists theirs.
GOALS := $(or $(MAKECMDGOALS),help)
OF_ALL := DISTRO PYTHON SOURCED VENV
GIVEN := $(filter-out $(OF_ALL),$(foreach name,$(.VARIABLES),$(if $(filter command,$(origin $(name))),$(name))))
ifneq ($(GIVEN),)
OPTIONS := $(OF_ALL) $(shell awk -F: -v goals=' $(GOALS) ' 'index(goals, " " $$1 " ") && /## / { \
	while (match($$0, /[A-Z_]+=/)) { print substr($$0, RSTART, RLENGTH - 1); $$0 = substr($$0, RSTART + RLENGTH) } }' Makefile)
UNKNOWN := $(firstword $(filter-out $(OPTIONS),$(GIVEN)))
ifneq ($(UNKNOWN),)
NEAREST := $(shell $(PYTHON) -c 'import difflib, sys; print(*difflib.get_close_matches(sys.argv[1].upper(), sys.argv[2:], 1))' \
	'$(UNKNOWN)' $(OPTIONS) 2>/dev/null)
$(error $(UNKNOWN) is not an option of make $(GOALS); $(if $(NEAREST),did you mean $(NEAREST)?,known are $(sort $(OPTIONS))))
endif
endif

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:
.PHONY: help sim sitl-demo campaign check test test-oldest test-learning lint coverage mutants format docs docs-check bench reproduce compare soak lock sbom audit clean

help: ## List the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/\1 \2/p' $(MAKEFILE_LIST) | while read -r target text; do \
		printf 'make %-13s %s\n' "$$target" "$$text"; done

sim: $(SIM) ## Fly a mission: SCENARIO=file RULES=name PLANNER=name PLAN=file MODEL=file NUM_DRONES=n SEED=n OUT=folder MOVIE=file RATE=steps/s VIEW=1
	@$(BIN)/run_mission $(MISSION) $(PLAN_OF) $(RATE_OF) $(MOVIE_OF) $(if $(VIEW),--view)

sitl-demo: $(SIM) ## Fly a search with three simulated autopilots: SCENARIO=file RULES=name PLANNER=name MODEL=file NUM_DRONES=n SEED=n OUT=folder
	@$(BIN)/python test/vehicles/control/sitl_demo.py $(MISSION)

campaign: $(VENV)/.campaign ## Play a campaign and report it: CONFIG=file OUT=folder
	@$(BIN)/campaign '$(or $(CONFIG),examples/campaign.yaml)' $(if $(OUT),--out '$(OUT)')

check: lint $(VENV)/.compiled ## Lint, check the types and run the quick tests without DDS
	@$(BIN)/pytest $(WITHOUT_NODES) -m 'not slow' $(TESTS_OF_CHECK)

test: lint $(VENV)/.compiled ## Lint, check the types and run all tests; lists the slowest
	@ROS_PYTHON_CHECK_FIELDS=1 $(BIN)/pytest $(WITH_NODES) --durations=15

test-oldest: ## Run a part of the tests with the oldest versions that setup.py admits
	@$(MAKE) --no-print-directory VENV=$(VENV)-oldest .test-oldest

.PHONY: .test-oldest
.test-oldest: $(VENV)/.compiled-oldest
	@ROS_PYTHON_CHECK_FIELDS=1 $(BIN)/pytest $(WITHOUT_NODES) $(TESTS_OF_OLDEST)

test-learning: ## Run the tests that need PyTorch, with an environment of their own of 8 GB
	@$(MAKE) --no-print-directory VENV=$(VENV)-learning .test-learning

.PHONY: .test-learning
.test-learning: $(VENV)/.compiled-learning
	@$(BIN)/pytest --durations=5 $(TESTS_OF_LEARNING)

lint: $(VENV)/.test ## Lint and check the types
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check
	@$(BIN)/mypy

coverage: $(VENV)/.compiled $(VENV)/.quality ## Measure which branches the tests take, package by package
	@$(BIN)/pytest $(WITHOUT_NODES) $(TESTS_OF_COVERAGE) --cov

mutants: $(VENV)/.test $(VENV)/.quality ## Test the tests of fence, upload and commands by changing those: MUTANTS='name ...'
	@$(BIN)/mutmut run --max-children 2 $(MUTANTS)
	@$(BIN)/mutmut results

format: $(VENV)/.test ## Format the code and mend what the linter can
	@$(BIN)/ruff check --fix
	@$(BIN)/ruff format

docs: $(VENV)/.docs ## Build the documentation site in docs/_build; a warning is an error
	@$(BIN)/sphinx-build -q --fail-on-warning --keep-going --conf-dir docs . docs/_build
	@echo docs/_build/index.html

docs-check: ## Run the commands of README and docs in a scratch clone, half an hour or more: DOCS='page ...'
	@$(PYTHON) docs/check.py $(DOCS)

bench: $(VENV)/.test ## Measure beside the published packages and a C baseline: BENCH=--quick
	@$(BIN)/python -m benchmarks.bench $(BENCH)

reproduce: $(VENV)/.test ## Replay the published tables
	@$(BIN)/python -m benchmarks.reproduce

compare: $(VENV)/.test ## Compare all planners on the same missions: MISSIONS=n of each
	@$(BIN)/python -m benchmarks.compare --missions '$(or $(MISSIONS),2000)'

soak: $(VENV)/.soak ## Keep every promise of reliability for long: SOAK='--only load late_joiner'
	@$(BIN)/python -m soak $(SOAK)

# For all Pythons and platforms; UV finds what it needs where pip does by default, or by its own settings.
LOCK := $(BIN)/uv pip compile --quiet --universal --python-version 3.10 --generate-hashes --upgrade \
	--custom-compile-command 'make lock' --no-annotate --no-python-downloads
lock: $(VENV)/.quality ## Pin the versions for the tests again, each file by its hash
	@$(LOCK) setup.py --extra $(subst $(COMMA), --extra ,$(OF_TESTS)) --output-file requirements.lock
	@for distro in jazzy kilted; do $(MAKE) --no-print-directory DISTRO=$$distro .lock; done

.PHONY: .lock
.lock:
	@printf '%s\n' 'setuptools>=70.1' $(WHEELS_$(DISTRO)) | \
		$(LOCK) --constraint requirements.lock --output-file requirements-$(DISTRO).lock -

sbom: $(VENV)/.quality build/requirements-$(DISTRO).txt ## Write a bill of materials of what the tests are run with, as CycloneDX
	@$(BIN)/cyclonedx-py requirements --output-reproducible --output-file build/sbom.json build/requirements-$(DISTRO).txt
	@echo build/sbom.json

audit: $(VENV)/.quality build/requirements-$(DISTRO).txt ## Look up known weaknesses of what the tests are run with
	@$(BIN)/pip-audit --disable-pip --require-hashes --requirement build/requirements-$(DISTRO).txt

# What is in both stands there once.
build/requirements-$(DISTRO).txt: requirements.lock requirements-$(DISTRO).lock
	@mkdir -p build
	@awk '/^[^ #]/ { keep = !seen[$$0]++ } keep' $^ > $@

clean: ## Remove the environment and everything built
	rm -rf $(VENV) $(VENV)-oldest $(VENV)-learning build dist docs/_build install log mutants .coverage *.egg-info .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +

# A sourced ROS 2 comes with packages of its own, with which its own were compiled: they are not replaced.
$(BASE): $(if $(SOURCED),,$(wildcard requirements-$(DISTRO).lock))
	$(if $(SOURCED)$(WHEELS_$(DISTRO)),,$(error DISTRO=$(DISTRO): choose jazzy or kilted))
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null || \
		{ echo '$(PYTHON) is not Python 3.10 or later: name one with PYTHON=...' >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
		{ echo '$(PYTHON) cannot create virtual environments: install python3-venv' >&2; exit 1; }
	@echo 'Setting up $(VENV) with $(if $(SOURCED),the sourced ROS 2 $(SOURCED),ROS 2 $(DISTRO) from wheels)'
	@rm -rf $(VENV)
	@$(PYTHON) -m venv $(if $(SOURCED),--system-site-packages) $(VENV)
	@$(PIP_INSTALL) $(if $(SOURCED),'setuptools>=70.1',$(LOCKED) requirements-$(DISTRO).lock)
	@touch $@

$(SOURCES): $(BASE)
	@rm -f $(VENV)/.sources-*
	@touch $@

# Requirements are looked at again only when they may have changed. The build has a new folder of
# its own each time: setuptools would pack the modules that an earlier one left behind.
$(SIM): EXTRAS := $(OF_SIM)
$(VENV)/.campaign: EXTRAS := viz,area,campaign
$(VENV)/.test: EXTRAS := $(OF_TESTS)
$(VENV)/.test: $(if $(SOURCED),,requirements.lock)
$(VENV)/.quality: EXTRAS := quality
$(VENV)/.soak: EXTRAS := viz,area,onnx,test,record,dashboard,viewer,soak
$(VENV)/.docs: EXTRAS := viz,area,record,docs
$(VENV)/.learning: EXTRAS := viz,area,onnx,test,train,sb3,learning
$(VENV)/.oldest: EXTRAS := viz,area,test
$(VENV)/.oldest: CONSTRAINTS := --constraint $(VENV)/oldest.txt
$(VENV)/.oldest: $(VENV)/oldest.txt
TO_RESOLVE = $(if $(filter requirements.lock,$^),,$(filter $(BASE) $(VENV)/oldest.txt setup.py,$?))
$(SIM) $(VENV)/.campaign $(VENV)/.test $(VENV)/.quality $(VENV)/.docs $(VENV)/.soak $(VENV)/.learning $(VENV)/.oldest: \
		$(BASE) setup.py $(SOURCES)
	@echo 'Installing the package'
	$(if $(filter requirements.lock,$?),@$(PIP_INSTALL) $(LOCKED) requirements.lock)
	@rm -rf $(VENV)/build && mkdir $(VENV)/build
	@printf '[%s]\n%s = $(VENV)/build\n' build build_base egg_info egg_base > $(VENV)/build/cfg
	@DIST_EXTRA_CONFIG=$(VENV)/build/cfg $(PIP_INSTALL) --no-build-isolation \
		$(CONSTRAINTS) $(if $(TO_RESOLVE),'.[$(EXTRAS)]',--no-deps .)
	@touch $@

# Otherwise each worker would compile the search and the tests, and each node that starts before one
# has. A test that cannot be collected is reported by the target that runs it.
$(VENV)/.compiled: $(VENV)/.test
$(VENV)/.compiled-oldest: $(VENV)/.oldest
$(VENV)/.compiled-oldest: TO_COLLECT := $(TESTS_OF_OLDEST)
# Hardly any of these tests has a belief, a planner or faults.
$(VENV)/.compiled-oldest: TO_COMPILE := worlds
$(VENV)/.compiled-learning: $(VENV)/.learning
$(VENV)/.compiled-learning: TO_COLLECT := $(TESTS_OF_LEARNING)
$(VENV)/.compiled $(VENV)/.compiled-oldest $(VENV)/.compiled-learning:
	@echo 'Compiling the search and the tests'
	@$(BIN)/python test/search/environments/compiled.py $(TO_COMPILE)
	@$(BIN)/pytest --collect-only --quiet $(TO_COLLECT) >/dev/null 2>&1 || true
	@touch $@

# Every lower bound as the version itself; pyparsing 3.3 warns of what Matplotlib 3.6 does.
$(VENV)/oldest.txt: $(BASE) setup.py
	@rm -rf $(VENV)/build && mkdir $(VENV)/build
	@$(BIN)/python setup.py -q egg_info --egg-base $(VENV)/build
	@sed -n 's/\[.*\]//; s/^\([A-Za-z].*\)>=\([^,]*\).*/\1==\2/p' $(VENV)/build/*/requires.txt > $@
	@echo 'pyparsing<3.3' >> $@
