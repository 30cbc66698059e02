# What each part promises, on two cores, installation aside:
#   make test         Every feature works, on this machine as it is; at most 5 minutes.
#                     Nothing in it needs a quiet machine.
#   make slow         What needs patience or quiet: each controller of the zoo on every
#                     sandbox tier, each bundled map, long sweeps of seeds, killed runs.
#   make slow-sample  120 of these tests, drawn by SAMPLE; CI draws by the commit's hash.
#   make test-all     Both, and lint: what must pass before a release.
#   make portability  Other people's machines: no bubblewrap, each tier, lowest and newest
#                     versions, other Pythons, another user, other processors, a busy
#                     machine. A table says what could not be tried, and why. Some rows:
#                     make portability ROWS="lowest wheel-user"
#   make lint         Style, types, and who may import whom.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# Chooses which slow tests are run by slow-sample.
SAMPLE ?= 1
# A file's tests share what they need, so they are run by one process; in their order
# the files with short tests come last, and both processes end together.
PARALLEL := -q -n 2 --dist loadfile --no-loadscope-reorder

.PHONY: synth test test-all slow slow-sample lint bench portability clean

synth: $(VENV)/.installed
	$(BIN)/tdac synth

test: $(VENV)/.test-installed
	$(BIN)/pytest $(PARALLEL) -m "not slow"

test-all: test slow lint

slow: $(VENV)/.test-installed
	$(BIN)/pytest $(PARALLEL) -m slow

slow-sample: $(VENV)/.test-installed
	TDAC_SLOW_SAMPLE=$(SAMPLE) $(BIN)/pytest $(PARALLEL) -m slow

portability:
	$(PYTHON) tools/portability $(ROWS)

bench: $(VENV)/.installed
	$(BIN)/pip install --quiet -e ".[bench]"
	$(BIN)/python -m benchmarks

lint: $(VENV)/.lint-installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip
	$(BIN)/pip install --quiet -e .
	touch $@

$(VENV)/.test-installed: $(VENV)/.installed
	$(BIN)/pip install --quiet -e ".[test]"
	$(BIN)/tdac warm
	touch $@

$(VENV)/.lint-installed: $(VENV)/.test-installed
	$(BIN)/pip install --quiet -e ".[lint]"
	touch $@

clean:
	rm -rf $(VENV) build dist
