# Two commands do everything on a fresh machine: `make eval` and `make test`.
PYTHON ?= python3.11
BIN := .venv/bin
AGENT ?= mmn

.PHONY: eval test check check-full bench clean

# Made anew where what is installed may have changed.
.venv/installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

eval: .venv/installed
	$(BIN)/mazebench eval --agent $(AGENT)

test: .venv/installed
	$(BIN)/pytest -n auto -m "not slow"

check: .venv/installed
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(MAKE) test

check-full: check
	$(BIN)/pytest -m slow

bench: .venv/installed
	$(BIN)/mazebench bench

clean:
	rm -rf .venv build dist *.egg-info
