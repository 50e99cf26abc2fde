# Every target works from a bare checkout and reinstalls nothing on a second call.
PY := .venv/bin/python
STAMP := .venv/.installed
DEV_STAMP := .venv/.installed-dev
PIP := $(PY) -m pip install --quiet --disable-pip-version-check -c constraints.txt

.PHONY: demo test lint types bench wheel clean

demo: $(STAMP)
	.venv/bin/vrs demo

test: $(DEV_STAMP) lint types
	$(PY) -m pytest -n 2

lint: $(DEV_STAMP)
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .

types: $(DEV_STAMP)
	.venv/bin/mypy

bench: $(DEV_STAMP)
	$(PY) -m benchmarks

$(PY):
	@sh .ci/venv

$(STAMP): pyproject.toml constraints.txt | $(PY)
	$(PIP) -e .
	@touch $@

$(DEV_STAMP): $(STAMP)
	$(PIP) -e '.[dev]'
	@touch $@

# The wheel, in an empty environment outside the checkout, does the main job.
wheel: $(DEV_STAMP)
	@sh .ci/wheel

clean:
	rm -rf .venv build dist *.egg-info out
