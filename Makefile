# Each target sets up whatever it needs: the virtual environment .venv with pinned packages, and system libraries.
.PHONY: setup demo test lint bench
.DELETE_ON_ERROR:

BIN := .venv/bin
READY := .venv/ready

setup: $(READY)

demo: $(READY)
	@$(BIN)/inspect3d demo --out out/demo

test: $(READY)
	@$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist worksteal

lint: $(READY)
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check
	@$(BIN)/mypy

bench: $(READY)
	@set -e; for benchmark in benchmarks/*.py; do $(BIN)/python "$$benchmark"; done

$(READY): pyproject.toml constraints.txt .ci/setup
	@.ci/setup
	@touch $@
