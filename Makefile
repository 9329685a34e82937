# `make run` and `make test` do all set-up on a fresh machine with Python 3.11 and make.

PYTHON ?= $(shell command -v python3.11 || command -v python3)
JOBS ?= 2
DATA ?= data/sim
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
# Without it PyPI's build for Linux would bring gigabytes of CUDA; the tests need none of it.
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu
EXTRAS := capture,cluster,dev,heic,litert,raw,render,sun,train,usd

# The tests run in $(JOBS) processes; without this each would start a thread per core.
export OMP_NUM_THREADS ?= 1

.DEFAULT_GOAL := help
.PHONY: help run test test-lab slow lint types coverage docs fuzz ci bench results ablation round-trip web web-test web-e2e web-ci npm-package npm-test release release-test release-version clean

help:
	@echo "make run    estimate the light of the example photos (small install, no torch)"
	@echo "make test   run the tests (installs everything, CPU torch too)"
	@echo "make test-lab  the tests of the experiments in lab/, which are no part of the program"
	@echo "make slow   the long tests that both leave out (minutes each)"
	@echo "make lint   ruff, mypy, import rules; make types: mypy alone"
	@echo "make docs   the documents as a site, with the API reference, in out/site"
	@echo "make coverage  the tests, and that they reach 95 % of the lines"
	@echo "make fuzz   damaged files of every format into every reader (CASES=per format)"
	@echo "make ci     what CI runs: lint, the live page's tests (if there is node), test, test-lab"
	@echo "make bench  measure speeds (DATA=folder: a data set from deeplight simulate)"
	@echo "make results evaluate the model on DATA and rewrite the numbers in the documents"
	@echo "make ablation  train and measure table 1 and the learning curve on DATA (IMAGENET=weights)"
	@echo "make round-trip  our light in Mitsuba, Blender, three.js, Babylon.js (node, chromium)"
	@echo "make web    build the live page that \`deeplight demo\` serves (node 20 or newer)"
	@echo "make web-test, web-e2e   its unit tests; the built page in a real browser"
	@echo "make npm-package, npm-test   build the npm package, gate its size; try it in a bare project"
	@echo "make release, release-test   all that is published, in dist/; the wheel in an empty environment"
	@echo "make clean  remove the virtual environment and caches"

run: $(VENV)/.installed-base
	$(BIN)/deeplight estimate examples/photos --out out/examples
	@echo
	@echo "To look at: out/examples/*.preview.png (the photo, its light, the three spheres)"
	@echo "To light with: out/examples/*.exr, described by *.json"

# A file's tests stay in one process: what they share is made once. tests/conftest.py orders them.
SHARED_OUT := -n $(JOBS) --dist loadfile --no-loadscope-reorder

# Large arrays stay with the process that frees them: asking the system for each anew took a
# seventh of the tests' time. And modules are compiled once, not in each process.
test test-lab coverage: export MALLOC_MMAP_THRESHOLD_ ?= 268435456
test test-lab coverage: export MALLOC_TRIM_THRESHOLD_ ?= 1073741824
unexport PYTHONDONTWRITEBYTECODE

test: $(VENV)/.installed-test
	$(BIN)/pytest $(SHARED_OUT) --ignore=tests/lab

test-lab: $(VENV)/.installed-test
	$(BIN)/pytest $(SHARED_OUT) tests/lab

lint: $(VENV)/.installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

types: $(VENV)/.installed-test
	$(BIN)/mypy

slow: $(VENV)/.installed-test
	$(BIN)/pytest -m slow -n $(JOBS) --timeout 3600

coverage: $(VENV)/.installed-test
	$(BIN)/pytest $(SHARED_OUT) --ignore=tests/lab --cov=deeplight --cov-report=term-missing:skip-covered --cov-fail-under=95

CASES ?= 1000

fuzz: $(VENV)/.installed-test
	$(BIN)/python -m lab.fuzz --cases $(CASES)

docs: $(VENV)/.installed-base
	$(PIP) install --quiet --editable ".[docs]"
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build

# The page is built before the tests, since some of them look at it.
ci: lint web-ci test test-lab

web-ci:
	@if command -v npm >/dev/null && node -e 'process.exit(process.versions.node.split(".")[0] < 20 ? 1 : 0)'; \
		then $(MAKE) web-test npm-package; \
		else echo "skipped: the live page's tests and build need node 20 or newer"; fi

bench: $(VENV)/.installed-test
	$(BIN)/python benchmarks/estimate_latency.py
	@test -d $(DATA) || { echo "the rest needs a data set: make bench DATA=folder"; exit 2; }
	$(BIN)/python benchmarks/dataset_reading.py $(DATA)
	$(BIN)/python benchmarks/data_loading.py $(DATA)

# The test places are looked at once per release: SPLITS="val seen" for everything before it.
SPLITS ?= val test seen

results: $(VENV)/.installed-test
	$(BIN)/deeplight evaluate --data $(DATA) --split $(SPLITS) --out out/evaluation
	$(BIN)/python -m lab.evidence.update_results out/evaluation

# Table 1 and the learning curve: ten trainings, an hour or two on two cores. It may be killed.
ablation: $(VENV)/.installed-test
	@test -f "$(IMAGENET)" || { echo "make ablation IMAGENET=folded MobileNetV2 weights (.npz)"; exit 2; }
	$(BIN)/python -m lab.evidence.equal_budget $(DATA) --imagenet $(IMAGENET)
	$(BIN)/deeplight evaluate --data $(DATA) --split val --model runs/equal --out out/equal
	$(BIN)/python -m lab.evidence.equal_budget_tables out/equal

# Blender's module brings its own numpy, so it gets an environment of its own, and so do the codecs.
round-trip: $(VENV)/.installed-test .round-trip/.installed
	DEEPLIGHT_BLENDER_PYTHON=.round-trip/blender/bin/python \
		DEEPLIGHT_IMAGECODECS_PYTHON=.round-trip/codecs/bin/python \
		DEEPLIGHT_NODE_MODULES=$(CURDIR)/.round-trip/node_modules \
		$(BIN)/pytest -m slow -s --timeout 600 tests/parity/test_mitsuba_export.py \
		tests/parity/test_blender.py tests/parity/test_blender_extension.py \
		tests/parity/test_three.py tests/parity/test_babylon.py \
		tests/parity/test_ultra_hdr.py tests/parity/test_ktx2.py

.round-trip/.installed:
	@for program in python3.11 node npm chromium; do command -v $$program >/dev/null \
		|| { echo "needs $$program (Debian: apt-get install nodejs npm chromium)"; exit 2; }; done
	python3.11 -m venv .round-trip/blender
	.round-trip/blender/bin/python -m pip install --quiet bpy==5.0.1
	python3.11 -m venv .round-trip/codecs
	.round-trip/codecs/bin/python -m pip install --quiet imagecodecs==2026.3.6
	npm install --silent --prefix .round-trip three@0.187.0 playwright-core@1.65.1 \
		babylonjs@9.34.0 babylonjs-loaders@9.28.0
	@touch $@

# The live page. Its JavaScript is built once; `deeplight demo` and the wheel need no node.

web: web/node_modules/.installed
	npm run --silent --prefix web build

web-test: web/node_modules/.installed
	npm run --silent --prefix web check
	npm run --silent --prefix web test

web-e2e: web
	npm run --silent --prefix web e2e

# The package that the page is built on. Both together: the gate measures both.
npm-package: web
	npm run --silent --prefix web build --workspace deeplight
	npm run --silent --prefix web sizes

# From the packed file, in a bare project with the registry's renderers: minutes, 400 MB, chromium.
npm-test: web/node_modules/.installed $(VENV)/.installed-base
	npm run --silent --prefix web tarball

# The wheel is made out of the sdist, so the sdist has all that it takes; both hold the built page.
RELEASE := dist
VERSION = $(shell sed -n 's/^version = "\(.*\)"/\1/p' pyproject.toml)

release: npm-package $(VENV)/.created
	rm -rf $(RELEASE) && mkdir $(RELEASE)
	$(PIP) install --quiet "hatchling>=1.27"
	$(BIN)/python -m hatchling build --target sdist --directory $(RELEASE)
	$(PIP) wheel --quiet --no-deps --no-build-isolation --wheel-dir $(RELEASE) $(RELEASE)/deeplight-$(VERSION).tar.gz
	npm pack --silent --ignore-scripts --prefix web --workspace deeplight --pack-destination $(abspath $(RELEASE))
	$(BIN)/python blender/build.py $(RELEASE)
	cd src/deeplight/demo/site && $(abspath $(BIN))/python -m zipfile --create $(abspath $(RELEASE))/deeplight-page-$(VERSION).zip *
	cd $(RELEASE) && mv deeplight-$(VERSION).tgz deeplight-npm-$(VERSION).tgz && sha256sum deeplight* > SHA256SUMS

# On GitHub GITHUB_REPOSITORY is OWNER/NAME: who installs the package must find its source.
release-version:
	@test -z "$(GITHUB_REPOSITORY)" || grep -q '^Source = .*$(GITHUB_REPOSITORY)' pyproject.toml \
		|| { echo "expected Source of [project.urls] to name $(GITHUB_REPOSITORY), got none: add it to pyproject.toml"; exit 2; }
	@test "$(TAG)" = "v$(VERSION)" || { echo "expected the tag v$(VERSION) of pyproject.toml, got $(TAG)"; exit 2; }
	@for file in CHANGELOG.md web/packages/deeplight/CHANGELOG.md; do grep -q '^## $(VERSION)' $$file \
		|| { echo "expected a heading $(VERSION) in $$file, got none"; exit 2; }; done

# Nothing but the wheel and what it asks for: no checkout on the path, no extras.
release-test:
	rm -rf out/release && mkdir -p out/release
	$(PYTHON) -m venv out/release/venv
	out/release/venv/bin/python -m pip --disable-pip-version-check install --quiet $(RELEASE)/deeplight-$(VERSION)-py3-none-any.whl
	cd out/release && env -u PYTHONPATH venv/bin/python $(CURDIR)/tests/packaging/release.py $(abspath $(RELEASE)) $(CURDIR)/examples/photos

web/node_modules/.installed: web/package-lock.json
	@command -v npm >/dev/null || { echo "needs node 20 or newer and npm (Debian: apt-get install nodejs npm)"; exit 2; }
	npm ci --silent --no-audit --no-fund --prefix web
	@touch $@

clean:
	rm -rf web/node_modules src/deeplight/demo/site .round-trip $(VENV) .pytest_cache .ruff_cache .mypy_cache .import_linter_cache .hypothesis

# Stamps, so that a second `make` starts at once and a changed dependency list installs again.

$(VENV)/.created:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "DeepLight needs Python 3.11 or newer: make PYTHON=/path/to/python3.11"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	@touch $@

$(VENV)/.installed-base: pyproject.toml | $(VENV)/.created
	$(PIP) install --quiet --editable .
	@touch $@

$(VENV)/.installed-test: pyproject.toml constraints.txt | $(VENV)/.created
	$(PIP) install --quiet --no-deps --retries 1 --extra-index-url "$(TORCH_INDEX)" \
		torch --constraint constraints.txt
	$(PIP) install --quiet --editable ".[$(EXTRAS)]" --constraint constraints.txt
	@touch $@ $(VENV)/.installed-base
