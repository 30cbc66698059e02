PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin

.PHONY: synth test slow lint bench clean

synth: $(VENV)/.installed
	$(BIN)/tdac synth

test: $(VENV)/.test-installed
	$(BIN)/pytest -q -n 2 -m "not slow"

slow: $(VENV)/.test-installed
	$(BIN)/pytest -q -n 2 -m slow

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
