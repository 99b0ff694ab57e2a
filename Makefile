# `make demo` and `make test` need nothing but Python 3.11 or later; they make .venv themselves.

PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	if $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; \
	then echo $$p; break; fi; done)
BIN := .venv/bin
DEMO := demo
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: demo test lint clean

demo: .venv/mcloc.installed
	$(BIN)/mcloc simulate --world museum --people 15 --length 80 --kidnap-at 80 --seed 4 \
		--out $(DEMO)
	$(BIN)/mcloc run --map $(DEMO)/map.yaml --log $(DEMO)/log --truth $(DEMO)/truth.csv \
		--seed 1 --out $(DEMO)/run --gif
	@echo "picture:   $(CURDIR)/$(DEMO)/run/run.png"
	@echo "animation: $(CURDIR)/$(DEMO)/run/run.gif"

test: lint
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile --cov --cov-report=term

lint: .venv/dev.installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

clean:
	rm -rf .venv $(DEMO) .coverage .*_cache

.venv/mcloc.installed: pyproject.toml | .venv
	@echo "installing mcloc into .venv (once) ..."
	@$(PIP_INSTALL) --editable .
	@touch $@

.venv/dev.installed: pyproject.toml | .venv
	@echo "installing mcloc and its checks into .venv (once) ..."
	@$(PIP_INSTALL) --editable '.[dev]'
	@touch $@ .venv/mcloc.installed

.venv:
	@if [ -z "$(PYTHON)" ]; then \
		echo "mcloc needs Python 3.11 or later: install it," \
			"or name it: make PYTHON=/path/to/python3" >&2; \
		exit 2; \
	fi
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "mcloc needs Python 3.11 or later, $(PYTHON) is older" >&2; exit 2; }
	$(PYTHON) -m venv .venv || { rm -rf .venv; exit 1; }
