# The chores, one word each. `make demo` and `make test` need only python3 (3.11 or newer), pip and make.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/installed
DEMO_STAMP := $(VENV)/demo_installed
# What `make demo` installs of constraints.txt: what the package itself needs, and its builder. A test holds it to that.
DEMO := click colorama dynamixel-sdk markdown-it-py mdurl numpy opencv-python-headless py-trees pydot pygments pyparsing \
	pyserial pyyaml rich editables hatchling packaging pathspec pluggy tomlkit trove-classifiers
OTHERS := tests/other_programs
OTHERS_STAMP := $(VENV)/other_programs_installed

PYODIDE := 314.0.7
PYODIDE_STAMP := $(VENV)/pyodide_$(PYODIDE)

.PHONY: help setup demo test tested fuzz payloads storm planted kills golden soak claims check bench docs fleet constraints clean
help: ## this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / {printf "make %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

define venv
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "missiontree needs Python 3.11 or newer, this is " + sys.version.split()[0] + "\n  try: make PYTHON=python3.12 $(MAKECMDGOALS)")'
	$(PYTHON) -m venv $(VENV)
endef

define install
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r $(1)
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
endef

$(STAMP): constraints.txt pyproject.toml
	$(venv)
	$(call install,constraints.txt)
	@touch $@ $(DEMO_STAMP)

# A third of it: no developers' tools.
$(DEMO_STAMP): constraints.txt pyproject.toml
	$(venv)
	@awk -v names="$(DEMO)" 'BEGIN {split(names, each, " "); for (i in each) wanted[each[i]]} \
		/^[a-z]/ {split($$1, part, "=="); taken = part[1] in wanted} taken' constraints.txt > $(VENV)/demo.txt
	$(call install,$(VENV)/demo.txt)
	@touch $@

# What the tests alone need, over what the other chores need.
$(OTHERS_STAMP): $(STAMP) $(OTHERS)/builder.txt $(OTHERS)/requirements.txt
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r $(OTHERS)/builder.txt
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --require-hashes --no-build-isolation -r $(OTHERS)/requirements.txt
	@touch $@

# Python for browsers, in which a test runs the wheel. Without npm or a network that test skips, and says so.
$(PYODIDE_STAMP): | $(STAMP)
	@if command -v npm > /dev/null && npm install --prefix $(VENV)/pyodide --no-save --no-audit --no-fund --silent \
		--fetch-retries 1 pyodide@$(PYODIDE); then touch $@; else echo "no Pyodide: its test skips"; fi

setup: $(STAMP) ## build .venv from constraints.txt, when it is missing or stale

demo: $(DEMO_STAMP) ## a simulated TurtleBot looks for a face, tracks it and greets it
	$(BIN)/mission run greet --simulate --robot turtlebot2_arm

# Tests start hundreds of processes: where the environment forbids to keep what Python compiles, each would do it anew.
# Many wait for real time, so there are two workers to a core, and one; those with deadlines of their own come at last, with fewer.
TESTED = PYTHONDONTWRITEBYTECODE= OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -p no:xdist -p tests.workers
test: $(OTHERS_STAMP) ## what CI runs: the checks, and every test
	@nice -n 19 $(MAKE) check > $(VENV)/checked.txt 2>&1 & checks=$$!; \
	$(MAKE) tested; tests=$$?; \
	wait $$checks; checks=$$?; cat $(VENV)/checked.txt; test $$tests = 0 && test $$checks = 0

tested: $(OTHERS_STAMP) $(PYODIDE_STAMP)
	$(TESTED) --workers $$(( 2 * $$(nproc) + 1 )) --real-time-workers $$(( $$(nproc) + 2 )) --durations 10 --durations-min 1

fuzz: $(OTHERS_STAMP) ## all of the campaigns, then the tests with random examples, new ones at each run, ten times over
	TRIES=most $(TESTED) -q --workers $$(nproc) $$(grep -rlE 'tries\(.*most=' tests --include='test_*.py')
	for round in 1 2 3 4 5 6 7 8 9 10; do \
		$(TESTED) -q -m hypothesis --hypothesis-profile fuzz --workers $$(nproc) || exit 1; done

payloads: $(OTHERS_STAMP) ## a million payloads of ROS 2 that chance has changed, told to all that hears them; PAYLOADS=100000
	PAYLOADS=$(or $(PAYLOADS),1000000) $(BIN)/pytest -q -n 0 --durations 1 --timeout 0 tests/drivers/ros2/test_ros2_noise.py

storm: $(STAMP) ## 2000 random missions under random faults; SEEDS=20000 FIRST=1 for more, or others
	$(BIN)/python -m tests.storm --seeds $(or $(SEEDS),2000) --first $(or $(FIRST),1)

planted: $(STAMP) ## plant faults in a copy of the code, and tell with how many seeds the storm finds each; SEEDS=150 FIRST=500000
	$(BIN)/python -m tests.planted --seeds $(or $(SEEDS),150) --first $(or $(FIRST),500000)

kills: $(STAMP) ## kill -9 runs, recorders and servers at 500 random moments each, and write down the figures
	$(BIN)/python -m docs.claims "run killed" "recorder killed" "server killed"
	$(BIN)/python docs/generate.py

golden: $(STAMP) ## renew the golden records that are decided otherwise, which is meant: BECAUSE="why"
	$(BIN)/python -m tests.missions.records.golden --because "$(BECAUSE)"

soak: $(STAMP) ## eight simulated hours of driving, looking and speaking, as plots of what they cost: HOURS=1 FILE=soak.svg
	$(BIN)/python -m tests.benchmarks.soak --hours $(or $(HOURS),8) $(or $(FILE),soak.svg)

claims: $(OTHERS_STAMP) ## show every claim of docs/reliability.md, which takes hours, and write down the figures
	$(BIN)/python -m docs.claims
	$(BIN)/python docs/generate.py

fleet: $(OTHERS_STAMP) ## 50 robots do 1000 tasks while they are killed and cut off; ROBOTS=5 TASKS=100 for less
	$(BIN)/python -m tests.missions.service.fleet_campaign $(or $(ROBOTS),50) $(or $(TASKS),1000) $(or $(KILLS),60) $(or $(CUTS),40) 8

check: $(STAMP) ## style, types and the arrows between the packages
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m tests.wording

bench: $(STAMP) ## the benchmarks, as ratios measured side by side
	$(BIN)/python -m tests.benchmarks

walks: $(STAMP) ## humanoids in physics, 100 walks each: falls, speed, energy; half an hour
	$(BIN)/python -m tests.benchmarks.walking

docs: $(STAMP) ## write the tables of docs/ anew from the declarations
	$(BIN)/python docs/generate.py

constraints: $(STAMP) ## write constraints.txt anew from the newest releases
	$(BIN)/pip install --quiet uv
	$(BIN)/uv pip compile --quiet --universal --generate-hashes --no-annotate --no-header --extra dev --python-version 3.11 \
		--upgrade pyproject.toml -o $(VENV)/constraints.txt
	(head -n 1 constraints.txt; cat $(VENV)/constraints.txt) > $(VENV)/new && mv $(VENV)/new constraints.txt

clean: ## forget what was built
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis
