# make demo    from nothing: environment, demo motions, retargeting, report, video, page, picture
# make test    the test suite                make quick   its quick part, in ten minutes
# make check   lint, format, types, rooms    make bench   benchmarks
# make docs    the site, in site/            make wheel   build, install elsewhere, run
# make fuzz    spoilt files against every reader, a minute each (SECURITY.md)
# make clean   remove what these made

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
export OMP_NUM_THREADS ?= 1

.PHONY: demo test quick check docs bench fuzz wheel clean
.DELETE_ON_ERROR:

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "spark-sim needs Python 3.11 or newer; name one: make PYTHON=python3.12" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

# Two environments in one folder, so that the demo need not wait for torch and the test tools.
$(VENV)/.video: $(BIN)/python pyproject.toml constraints.txt
	$(PIP) install --quiet -c constraints.txt -e ".[video]"
	@touch $@

$(VENV)/.dev: $(BIN)/python pyproject.toml constraints.txt
	$(PIP) install --quiet -c constraints.txt -e ".[dev]"
	@touch $(VENV)/.video $@

$(VENV)/.docs: $(BIN)/python pyproject.toml constraints.txt
	$(PIP) install --quiet -c constraints.txt -e ".[docs]"
	@touch $@

$(VENV)/.gl: $(VENV)/.video scripts/headless_gl.sh
	bash scripts/headless_gl.sh $(BIN)/python
	@touch $@

# What judges our GLBs, where there is npm; without it those tests are skipped, by name.
$(VENV)/.node: $(BIN)/python tests/node/package.json
	@command -v npm >/dev/null || { echo "no npm: GLBs are not validated in the tests"; exit 0; } && \
	  npm install --prefix tests/node --no-package-lock --ignore-scripts --no-audit --no-fund --silent \
	    --fetch-retries=1 --fetch-timeout=30000 && \
	  touch $@ || echo "npm installed nothing: GLBs are not validated in the tests"

demo: $(VENV)/.video $(VENV)/.gl
	bash scripts/demo.sh $(BIN)/spark-sim out

# Types and shapes are checked in each call of the quick tests; in the slow ones that would take four
# times as long.
test: $(VENV)/.dev $(VENV)/.gl $(VENV)/.node
	$(BIN)/pytest -n 2 --dist worksteal -rs -m "not slow and not bench"
	$(BIN)/pytest -n 2 --dist worksteal -rs -m "slow and not bench" --jaxtyping-packages=

quick: $(VENV)/.dev $(VENV)/.gl $(VENV)/.node
	$(BIN)/pytest -n 2 --dist worksteal -m "not slow and not bench"

check: $(VENV)/.dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/pytest tests/test_architecture.py

docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "Open site/index.html in a browser."

bench: $(VENV)/.dev
	@mkdir -p out
	$(BIN)/pytest tests/bench -m bench -o addopts= -q --benchmark-json=out/bench.json \
	  --benchmark-columns=min,median,stddev,rounds
	$(BIN)/python scripts/bench_table.py out/bench.json
	$(BIN)/python -m scripts.batch_bench --plot out/shelf.svg

# Led by coverage where atheris has a wheel for this Python, else by hypothesis.
fuzz: $(VENV)/.dev
	@$(PIP) install --quiet --only-binary :all: atheris==3.0.0 || true
	$(BIN)/python -m tests.fuzz

wheel: $(VENV)/.dev
	bash scripts/wheel_test.sh $(BIN)/python

clean:
	rm -rf $(VENV) build dist out site .benchmarks .hypothesis .mypy_cache .pytest_cache .ruff_cache
