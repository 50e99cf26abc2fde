# Every target works from a bare checkout and reinstalls nothing on a second call.
PY := .venv/bin/python
STAMP := .venv/.installed
DEV_STAMP := .venv/.installed-dev
DOCS_STAMP := .venv/.installed-docs
BENCH_STAMP := .venv/.installed-bench
# Each of the suite's hundreds of processes would compile three hundred modules where the environment keeps Python
# from storing what it compiled.
export PYTHONDONTWRITEBYTECODE :=
# Everything by its hash; see there.
INSTALL := $(PY) .ci/install.py -e .

.PHONY: demo test slow without contract platforms hashes generate lint types docs docs-check bench reproduce soak faults
.PHONY: wheel clean

demo: $(STAMP)
	.venv/bin/vrs demo

test: $(DEV_STAMP) lint types
	$(PY) -m pytest -n 3 --durations=5

# What `make test` leaves out, so that it takes a quarter of an hour.
slow: $(DEV_STAMP)
	$(PY) -m pytest -n 3 --durations=5 -m slow

# The same as if PyBullet, and as if MuJoCo, weren't installed.
without: $(DEV_STAMP)
	VRS_WITHOUT=pybullet,pybullet_data $(PY) -m pytest -n 3 -rs
	VRS_WITHOUT=mujoco $(PY) -m pytest -n 3 -rs

# What must not change, through doors alone: commands, sockets, files, public packages; the slow papers, too.
contract: $(DEV_STAMP)
	$(PY) -m pytest -n 2 --no-loadscope-reorder --durations=5 -m "" tests/contract

# What is derived from the definitions of messages: the script that checks them in pages, the documents' tables.
generate: $(STAMP)
	$(PY) .ci/generate.py

lint: $(DEV_STAMP)
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	$(PY) .ci/generate.py --check

types: $(DEV_STAMP)
	.venv/bin/mypy

# Beside the peers; writes benchmarks/RESULTS.md. Takes some ten minutes.
bench: $(BENCH_STAMP)
	$(PY) -m benchmarks --write

# Every claim of every paper, and what is claimed beyond them, on one page: out/reproduce/reproduce.html.
reproduce: $(STAMP)
	.venv/bin/vrs lab localization --out out/reproduce/localization
	.venv/bin/vrs lab goals --out out/reproduce/goals
	.venv/bin/vrs lab control --out out/reproduce/control
	.venv/bin/vrs reproduce all --body mujoco --runs 5 --out out/reproduce/mujoco
	.venv/bin/vrs reproduce all --out out/reproduce --beyond out/reproduce/localization/summary.json \
		--beyond out/reproduce/goals/summary.json --beyond out/reproduce/control/summary.json \
		--beyond benchmarks/results.json \
		$(patsubst %,--beyond out/reproduce/mujoco/%.json,han2001 kim2002 tipsuwan)

# The documentation as a site, in out/site; a warning is an error.
docs: $(DOCS_STAMP)
	NO_MKDOCS_2_WARNING=1 $(PY) -m mkdocs build --quiet --strict

# Whether all that is needed, with extras, has wheels and hashes for each machine and Python that README names.
platforms: $(DEV_STAMP)
	$(INSTALL) platforms
	$(PY) .ci/platforms.py

# The hashes of all that constraints.txt names, for whatever machine: after a change there.
hashes: $(DEV_STAMP)
	$(INSTALL) platforms
	$(PY) -m uv pip compile --quiet --universal --no-deps --no-header --no-annotate --generate-hashes constraints.txt -o hashes.txt

# Every command of README and docs that takes too long for `make test`.
docs-check: $(DEV_STAMP)
	VRS_DOCS_SLOW=1 $(PY) -m pytest tests/test_docs.py

$(PY):
	@sh .ci/venv

$(STAMP): pyproject.toml constraints.txt hashes.txt .ci/install.py | $(PY)
	$(INSTALL)
	@touch $@

$(DEV_STAMP): $(STAMP)
	$(INSTALL) dev
	@touch $@

$(DOCS_STAMP): $(STAMP)
	$(INSTALL) docs
	@touch $@

$(BENCH_STAMP): $(STAMP)
	$(INSTALL) bench
	@touch $@

# A million random edits of every kind, each held to every law; VRS_SOAK_EDITS and VRS_SOAK_SEED change what is drawn,
# VRS_SOAK_ON=tcp://HOST:8786 has other machines' workers, which are started in a checkout, make the edits.
# A million packets of RSP over ten bad links, against a model; a million fuzzed datagrams for each core.
soak: export VRS_SOAK_EDITS ?= 1000000
soak: $(DEV_STAMP)
	$(PY) -m tests.vrs.test_soak
	$(PY) -m pytest tests/vrs/test_machine.py
	VRS_SOAK_PACKETS=100000 VRS_SOAK_DATAGRAMS=500000 $(PY) -m pytest tests/interfaces/rsp/test_exchange.py tests/interfaces/rsp/test_fuzz.py

# Every fault: processes killed, disks full, clocks that step, parsers fuzzed, floods, a day of virtual operation. Writes
# out/faults; takes some nine hours, `$(PY) -m tests.fault_suite --only ROW --tries N` less.
faults: $(DEV_STAMP)
	$(PY) -m tests.fault_suite
	$(PY) -m pytest -m faults tests/fault_suite

# The wheel, in an empty environment outside the checkout, does the main job; what that is made of: out/sbom.json.
wheel: $(DEV_STAMP)
	@sh .ci/wheel

clean:
	rm -rf .venv build dist *.egg-info out
