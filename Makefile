PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# A file's tests share what they need, so they are run by one process; in their order
# the files with short tests come last, and both processes end together.
PARALLEL := -q -n 2 --dist loadfile --no-loadscope-reorder

.PHONY: synth test slow slow-sample bench lint clean

synth: $(VENV)/.installed
	$(BIN)/tdac synth

test: $(VENV)/.test-installed
	$(BIN)/pytest $(PARALLEL) -m "not slow"

slow-sample: $(VENV)/.test-installed
	TDAC_SLOW_SAMPLE=1 $(BIN)/pytest $(PARALLEL) -m slow

slow: $(VENV)/.test-installed
	$(BIN)/pytest $(PARALLEL) -m slow

bench: $(VENV)/.installed
	$(BIN)/pip install --quiet -e ".[bench]"
	$(BIN)/python -m benchmarks

lint: $(VENV)/.lint-installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip
	$(BIN)/pip install --quiet -e .
	touch $@

$(VENV)/.test-installed: $(VENV)/.installed
	$(BIN)/pip install --quiet -e ".[test]"
	touch $@

$(VENV)/.lint-installed: $(VENV)/.test-installed
	$(BIN)/pip install --quiet -e ".[lint]"
	touch $@

clean:
	rm -rf $(VENV) build dist
