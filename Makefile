PYTHON ?= python3
VENV   ?= .venv
PY     := $(VENV)/bin/python
STAMP  := $(VENV)/.installed
LOCK   := requirements/dev.txt
COMPILE := $(PY) -m uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header
export PIP_DISABLE_PIP_VERSION_CHECK = 1
# Small matrices: threads of BLAS only get in the way of the two test processes.
export OMP_NUM_THREADS = 1
export OPENBLAS_NUM_THREADS = 1
.DELETE_ON_ERROR:
.PHONY: install serve demo test check bench lock clean

install: $(STAMP)

$(STAMP): $(LOCK) pyproject.toml Makefile
	@$(PYTHON) -c 'import sys; v=sys.version_info[:2]; sys.exit(0 if v>=(3,11) else "error: Python 3.11 or newer is needed; %s is %d.%d. Run: make PYTHON=/path/to/python3.11 install" % ((sys.executable,)+v))'
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "error: this Python lacks venv/ensurepip (Debian: apt-get install python3-venv)"; exit 1; }
	@if [ -x $(PY) ] && ! $(PY) -c 'import sys; sys.exit(sys.version_info[:2]<(3,11))' 2>/dev/null; then rm -rf $(VENV); fi
	[ -x $(PY) ] || $(PYTHON) -m venv $(VENV)
	$(PY) -m pip install -q --only-binary :all: --require-hashes -r $(LOCK)
	$(PY) -m pip install -q --no-deps --no-build-isolation --no-index -e .
	@touch $@

demo: install
	$(VENV)/bin/loopwright demo

serve: install
	$(VENV)/bin/loopwright serve

test: install
	$(PY) -m pytest -q -n 2 --dist worksteal

check: install
	$(PY) -m ruff format --check .
	$(PY) -m ruff check .
	$(PY) -m mypy
	$(VENV)/bin/lint-imports --no-cache

lock: install
	$(COMPILE) pyproject.toml -o requirements/runtime.txt
	$(COMPILE) pyproject.toml --group dev -o requirements/dev.txt
	$(COMPILE) pyproject.toml --extra cluster -c requirements/dev.txt -o requirements/cluster.txt
	$(COMPILE) pyproject.toml --group dev --group bench --group plants -c requirements/dev.txt -o requirements/bench.txt
	$(COMPILE) pyproject.toml --group dev --group plants -c requirements/dev.txt -o requirements/plants.txt

bench:
	$(MAKE) VENV=.venv-bench LOCK=requirements/bench.txt install
	.venv-bench/bin/python -m benchmarks

clean:
	rm -rf $(VENV) .venv-bench .venv-plants .mypy_cache .ruff_cache .pytest_cache .hypothesis
