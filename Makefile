# One command each; `make` alone lists them.
SHELL := bash
.SHELLFLAGS := -euo pipefail -c
CARGO := cargo
# Nothing that lints build ever runs but build scripts, so C libraries need no optimising there.
LINT = nice -n 19 env -u MAKEFLAGS CARGO_TARGET_DIR=$${CARGO_TARGET_DIR:-target}/lint CARGO_PROFILE_DEV_OPT_LEVEL=0 $(CARGO)
# Where rustup puts it, for shells that were opened before.
export PATH := $(PATH):$(HOME)/.cargo/bin
LISTEN ?= 127.0.0.1:8080
# Mesa's loader warns about a missing display on machines without one.
export NODEVICE_SELECT := 1

.PHONY: help setup web demo test test-pages test-lints test-crates check contract fuzz deny bench bundle drivers load pictures clips attacks

help:
	@echo "make setup     install the Debian packages that are missing"
	@echo "make web       build the web pages, which the next build of the daemon embeds"
	@echo "make demo      build, and serve the demo plaza on http://$(LISTEN)/"
	@echo "make test      formatting, lints, documentation and all tests, of the pages too, as CI runs them"
	@echo "make check     type-check and lint only"
	@echo "make contract  tries every operation of the interface's contract, as every role (Schemathesis; CASES=20)"
	@echo "make attacks   attacks a daemon in every way that is known, half an hour (tests/attacks/run.sh)"
	@echo "make fuzz      feeds what reads bytes from outside with such as nobody sends, ten minutes each (MINUTES=10)"
	@echo "make deny      holds the dependencies to deny.toml: advisories, licences, versions, sources (CHECKS=...)"
	@echo "make bench     the benchmarks"
	@echo "make bundle    a tar that measures any Vulkan device with one command (target/bundle/)"
	@echo "make drivers   the tests of whatever draws on a second Vulkan driver, and under Khronos' validation layer"
	@echo "make load      what the daemon answers to many callers at once, as a table"
	@echo "make pictures  every picture for judging, into target/pictures/"
	@echo "make clips     the demo's clips again, from the simulator"

setup:
	@deploy/setup.sh

# The pages' tools are fetched again only when what is locked of them changed.
web/node_modules/.installed: web/package-lock.json web/package.json web/.npmrc web/install.sh web/node/package-lock.json | setup
	web/install.sh
	touch $@

# Built only where something changed: the daemon, which embeds the pages, is built anew after that.
web/dist/index.html: web/node_modules/.installed $(shell find web/src web/public -type f ! -name '*.gen.ts') \
		web/index.html web/wall.html web/vite.config.ts web/tsconfig.json tests/golden/openapi.json
	cd web && npm run --silent build

web: setup web/dist/index.html

demo: setup web
	$(CARGO) build --release --locked
	target/release/videofields demo --listen $(LISTEN)

# Builds the pages, then the tests' programs, and runs these; lints run beside all of it with the lowest priority, so that they use the
# processors while programs are linked and tests wait. Cargo lets one command at a time into a target folder, so lints have their own. `env -u MAKEFLAGS` keeps
# make's limit of jobs from cargo, which would compile one file at a time under it.
test: setup
	$(CARGO) fmt --check
	$(MAKE) --jobs=3 test-pages test-crates test-lints
	cd web && npm run --silent e2e

test-pages: web
	cd web && npm run --silent check && npm run --silent test

# Warnings are errors here, but not in an editor.
test-lints: setup
	$(LINT) clippy --workspace --locked --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(LINT) doc --workspace --locked --no-deps --document-private-items --quiet

# Tests often wait, so that one more than there are processors run at once; each of them draws by itself, with one thread of Mesa's
# rasteriser.
test-crates: web
	env -u MAKEFLAGS LP_NUM_THREADS=1 RUST_TEST_THREADS=$${RUST_TEST_THREADS:-$$(($$(nproc) + 1))} $(CARGO) test --workspace --locked

check: setup
	$(LINT) clippy --workspace --locked --all-targets

# CASES=..., ROLES="admin operator viewer stranger" and SEED=... as tests/contract/run.sh has them; it needs Python with venv,
# and the network once.
contract: setup
	$(CARGO) build --release --locked
	tests/contract/run.sh

# ATTACKS="small_leaks ..." and SECONDS_MIXED=... as tests/attacks/run.sh has them; ATTACK=--quick makes it minutes.
attacks: setup
	$(CARGO) build --release --locked
	tests/attacks/run.sh $(ATTACK)

# MINUTES=..., TARGETS="http_pictures ..." and SANITIZER=none as tests/fuzz/run.sh has them; it needs cargo-fuzz (cargo install --locked
# cargo-fuzz), and the network once.
fuzz: setup
	tests/fuzz/run.sh

# CHECKS="bans licenses sources" leaves out the advisories, whose database is fetched each time; it needs cargo-deny (cargo install
# --locked cargo-deny). An exception of deny.toml that nothing needs any more is an error.
CHECKS ?= advisories bans licenses sources
deny:
	cargo-deny --locked check -D unmatched-skip -D unnecessary-skip $(CHECKS)

# PYTHON=... names an interpreter that can import cv2, INPUT=... a video: then the mixture is timed beside OpenCV's.
bench: setup
	$(CARGO) bench --locked -p videofields-lab
ifdef INPUT
	$(CARGO) build --release --locked -p videofields-lab
	target/release/videofields-lab bench background --input $(INPUT) --size-px 1280x720 $(if $(PYTHON),--python $(PYTHON))
endif

bundle: setup
	deploy/bundle.sh

drivers:
	deploy/setup.sh chromium vulkan-validationlayers
	deploy/drivers.sh

# LOAD=... are further arguments, such as --seconds 30.
load: setup
	$(CARGO) build --release --locked -p videofields -p videofields-lab
	deploy/load.sh $(LOAD)

pictures: setup
	$(CARGO) build --release --locked -p videofields -p videofields-lab
	deploy/pictures.sh
	deploy/pictures-fused.sh
	deploy/pictures-hulls.sh
	deploy/pictures-fields.sh
	deploy/pictures-sequences.sh
	deploy/pictures-effects.sh

clips: setup
	$(CARGO) build --release --locked -p videofields-lab
	target/release/videofields-lab simulate --world plaza --out config/demo --truth-every 0 \
		--database ../../target/demo/videofields.sqlite
