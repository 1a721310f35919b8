# Two commands do everything on a fresh machine: `make eval` and `make test`.
PYTHON ?= python3.11
BIN := .venv/bin
AGENT ?= mmn

.PHONY: eval test docs check check-full release pythons bench clean

# Installs an extra: `agents` is what an evaluation needs, `dev` has everything. Made anew where it may have changed.
# Modules become bytecode when they are first imported, unless Python may not keep it: then pip makes it.
.venv/installed-%: pyproject.toml constraints.txt
	@echo "Installing mazebench[$*] into .venv: a minute or two, and as long as the downloads take."
	$(PYTHON) -m venv .venv
	$(BIN)/pip install $(if $(PYTHONDONTWRITEBYTECODE),,--no-compile) --disable-pip-version-check -c constraints.txt -e '.[$*]'
	touch .venv/installed-agents $@  # dev includes agents

eval: .venv/installed-agents
	$(BIN)/mazebench eval --agent $(AGENT)

test: .venv/installed-dev
	$(BIN)/pytest -n auto -m "not slow"

# Into site/; a warning is an error. The notice that is turned off is not about our pages.
docs: .venv/installed-dev
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet

check: .venv/installed-dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(MAKE) docs
	$(MAKE) test

check-full: check
	$(BIN)/pytest -m slow
	$(MAKE) pythons

# Into dist/, checked.
release: .venv/installed-dev
	AGENT=$(AGENT) .ci/release dist

# On every Python found; needs wheels of all dependencies.
pythons: release
	.ci/pythons "$$(ls -t dist/*.whl | head -n 1)"

bench: .venv/installed-agents
	$(BIN)/mazebench bench

clean:
	rm -rf .venv build dist site *.egg-info
