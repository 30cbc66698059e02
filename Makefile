# What each target checks; times are for two cores, without the installation:
#   make test         Every feature on this machine as it is; about four and a half minutes.
#                     No test needs a quiet machine.
#   make slow         Tests that take long or need a quiet machine: each controller of the
#                     zoo on every sandbox tier, each bundled map, many seeds, killed runs.
#   make slow-sample  80 of these tests, drawn by the seed SAMPLE; CI uses the commit hash.
#   make test-all     test, slow and lint: required before a release.
#   make portability  Other machines: no bubblewrap, each tier, lowest and newest versions,
#                     other Pythons, another user, other processors, a busy machine. The
#                     table also lists what could not run, and why. Selected rows:
#                     make portability ROWS="lowest wheel-user"
#   make clients      A short training with each RL library of docs/clients.md, installed
#                     in its own environment; prints a table. Selected libraries:
#                     make clients CLIENTS="sb3 skrl"
#   make results-rl   The trainings of results/ladder/learned: hours, not part of CI;
#                     after an interruption it goes on.
#   make notebooks    The notebooks, executed and kept with their outputs. Selected ones:
#                     make notebooks NOTEBOOKS="02 05"
#   make pictures     The pictures of the docs whose inputs have changed. Selected ones:
#                     make pictures PICTURES="studio.png"
#   make docs         The site, in build/site, with its links checked. The outputs of its
#                     notebooks must belong to their code; they are not executed.
#   make linkcheck    Links to other sites; needs a network.
#   make lint         Style, types, import rules, circles of imports, long modules, reads of
#                     files that bypass the safe reader, and long paragraphs of the docs.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# Seed of the tests that slow-sample draws.
SAMPLE ?= 1
# Tests of one file share fixtures, so one process runs them all. The given order puts
# files with short tests last, so that all processes end at about the same time. Three
# processes on two cores, since tests wait for others a third of the time.
# After a crash, a new process would wait for ever for the files of the old one.
PARALLEL := -q -n 3 --dist loadfile --no-loadscope-reorder --max-worker-restart 0

# Tests start hundreds of interpreters; without its cache, each compiles all that it imports.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: synth demo test test-all slow slow-sample lint bench portability clients results-rl \
	notebooks pictures docs linkcheck clean

synth: $(VENV)/.installed
	$(BIN)/tdac synth

demo: $(VENV)/.installed
	$(BIN)/tdac demo

test: $(VENV)/.test-installed
	$(BIN)/pytest $(PARALLEL) -m "not slow"

test-all: test slow lint

slow: $(VENV)/.test-installed
	$(BIN)/pytest $(PARALLEL) -m slow

slow-sample: $(VENV)/.test-installed
	TDAC_SLOW_SAMPLE=$(SAMPLE) $(BIN)/pytest $(PARALLEL) -m slow

portability:
	$(PYTHON) tools/portability $(ROWS)

clients:
	$(PYTHON) tools/clients $(CLIENTS)

bench: $(VENV)/.installed
	$(BIN)/pip install --quiet -e ".[bench]"
	$(BIN)/python -m benchmarks

results-rl: $(VENV)/.installed
	$(BIN)/pip install --quiet -e ".[sb3]"
	$(BIN)/python -m benchmarks.ladder_trainings runs/results-rl --keep results/ladder/learned

notebooks: $(VENV)/.test-installed
	$(BIN)/python -m tools.notebooks $(NOTEBOOKS)

pictures: $(VENV)/.test-installed
	$(BIN)/python -m tools.pictures $(PICTURES)

docs: $(VENV)/.docs-installed
	$(BIN)/python -m tools.notebooks --check
	$(BIN)/sphinx-build -W --keep-going -q -j auto -b html -c docs . build/site
	@echo "built: build/site/index.html"

linkcheck: $(VENV)/.docs-installed
	$(BIN)/sphinx-build -q -b linkcheck -c docs . build/links

lint: $(VENV)/.lint-installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m tools.sizes >/dev/null
	$(BIN)/python -m tools.raw_reads
	$(BIN)/python -m tools.english

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip
	$(BIN)/pip install --quiet -e .
	touch $@

$(VENV)/.test-installed: $(VENV)/.installed
	$(BIN)/pip install --quiet -e ".[test]"
	$(BIN)/tdac warm
	touch $@

$(VENV)/.docs-installed: $(VENV)/.installed
	$(BIN)/pip install --quiet -e ".[docs]"
	touch $@

$(VENV)/.lint-installed: $(VENV)/.test-installed
	$(BIN)/pip install --quiet -e ".[lint]"
	touch $@

clean:
	rm -rf $(VENV) build dist
