# The two commands of a new machine: `make demo` and `make test`. Each sets up .venv from the lock first.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
DISPATCHED := from numpy._core import _multiarray_umath as m; print(*(f for f in m.__cpu_dispatch__ if m.__cpu_features__[f]))

.PHONY: demo test anywhere oldest lint types docs bench study lock release clean

demo: $(READY)
	$(BIN)/python -m demo

test: $(READY)
	$(BIN)/pytest $(TEST)

# The same as other processors compute: three kernels of the linear algebra, numpy without what it chooses at run time.
anywhere: $(READY)
	for kernel in Haswell Nehalem SkylakeX; do OPENBLAS_CORETYPE=$$kernel $(BIN)/pytest --random-order $(TEST) || exit 1; done
	NPY_DISABLE_CPU_FEATURES="$$($(BIN)/python -c '$(DISPATCHED)')" $(BIN)/pytest --random-order $(TEST)

lint: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

types: $(READY)
	$(BIN)/mypy

docs: $(READY)
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html

bench: $(READY)
	$(BIN)/python -m benchmarks $(BENCH)

study: $(READY)
	$(BIN)/python -m studies $(STUDY)

$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit("counterpoise needs Python 3.11 or newer, this is %d.%d: make PYTHON=python3.12" % sys.version_info[:2] if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

# Needs uv: the only step that asks the package index what is new.
lock:
	uv pip compile --universal --python-version 3.11 --generate-hashes --no-header --no-annotate \
	  --fork-strategy fewest --group dev pyproject.toml -o requirements.lock

# The suite with the oldest versions that pyproject.toml accepts; their own deprecations are theirs. Needs uv.
oldest:
	uv venv --clear .venv-oldest
	uv pip install --python .venv-oldest/bin/python --resolution lowest-direct --group dev --editable .
	.venv-oldest/bin/python -m pytest -W default $(TEST)

# Wheel, sdist and the bill of materials (CycloneDX) of the locked environment, in dist/. Needs uv.
release:
	uv build
	uvx --from cyclonedx-bom cyclonedx-py requirements requirements.lock -o dist/counterpoise.cdx.json

clean:
	rm -rf $(VENV) .venv-oldest build dist demo-output study-output .pytest_cache .mypy_cache .ruff_cache
