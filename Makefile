# Two commands are all it takes: `make render` draws the gallery, `make test` runs every test.
# Both make .venv, install Halfstep into it and, where it is missing, install Mesa's Vulkan driver
# with apt-get. Later runs find all that done.

VENV := .venv
PYTHON := $(VENV)/bin/python
INSTALLED := $(VENV)/installed

.PHONY: render test quick shaders test-swiftshader test-dawn test-view lint fix layout \
    tables bench clean adapter lavapipe swiftshader

render: adapter
	$(PYTHON) -m halfstep render gallery -o gallery.png
	@echo "the picture is $(CURDIR)/gallery.png"

# Two processes: most tests wait for NumPy or for a compiler, which use one core each. The report
# lists lines of gpu/ that no test of the first session runs, except in processes that tests start.
# Of a shader with a planted fault only that it differs is seen, so LLVM may leave it as it is, which
# halves the time to compile it. A driver reads that variable once per process.
FAULTS := a_fault_is_seen or (a_fault_in and is_seen)
test: lavapipe
	HALFSTEP_EXPECT_LAVAPIPE=1 $(PYTHON) -m slipcover --source gpu --skip-covered \
	    -m pytest -n 2 --dist loadfile -k 'not ($(FAULTS))'
	HALFSTEP_EXPECT_LAVAPIPE=1 GALLIVM_PERF=nopt $(PYTHON) -m pytest -n 2 --dist loadfile \
	    -k '$(FAULTS)' $$(grep -lE 'def test_\w*a_fault_.*is_seen' tests/test_*.py)

# What needs no device and no patience: about a minute on an idle core, lint aside.
quick: lint
	$(PYTHON) -m pytest -q --quick

# Whether the device's compiler takes every shader, composed and as the files lie.
shaders: lavapipe
	HALFSTEP_EXPECT_LAVAPIPE=1 $(PYTHON) -m pytest -q tests/test_source.py tests/test_layout.py

# A second driver: another compiler, without 64-bit integers in shaders. What needs those, and types
# of floats that it lacks, is skipped here, and here alone.
SWIFTSHADER := /usr/lib/chromium/vk_swiftshader_icd.json
ON_SWIFTSHADER := VK_DRIVER_FILES=$(SWIFTSHADER) HALFSTEP_ADAPTER=SwiftShader \
    HALFSTEP_EXPECT_LAVAPIPE=no

# Tests of the plugin that take whatever driver there is need one that no variable asks for.
test-swiftshader: lavapipe swiftshader
	$(ON_SWIFTSHADER) $(PYTHON) -m halfstep check --all
	$(ON_SWIFTSHADER) $(PYTHON) -m halfstep check --all --method article
	$(ON_SWIFTSHADER) $(PYTHON) -m pytest --allow-missing-types tests/test_testing_*.py \
	    tests/test_canary.py tests/test_conformance.py tests/test_subnormals.py

# A second WebGPU: Dawn, which is Chrome's, with its compiler Tint, by the package wgpudawn. It takes
# SwiftShader, but not lavapipe of Mesa 22.3. Left out is what naga says, what opens a second device
# on one adapter, which Dawn has not, and a time.
DAWN_FILES := census compare faults files image inputs kernel kit layout levels loops manners names \
    overrides parameters program public public_shaders public_textures refusals returns textures
NOT_DAWN := shows_the_line or shown_as_it_is or larger or stored_answers or many_texts

test-dawn: swiftshader
	$(ON_SWIFTSHADER) $(PYTHON) -m pytest -p tests.dawn --allow-missing-types \
	    -k 'not ($(NOT_DAWN))' $(DAWN_FILES:%=tests/test_testing_%.py)

# A view as people see it: in Chromium, in a notebook and in a window. Screenshots go to
# .venv/view/pictures.
test-view: lavapipe
	@command -v chromium >/dev/null || { $(call apt_install,chromium); }
	@command -v Xvfb >/dev/null || { $(call apt_install,xvfb); }
	$(PYTHON) -m venv $(VENV)/view
	$(VENV)/view/bin/python -m pip install --quiet --disable-pip-version-check \
	    --editable '.[view]' ipykernel ipywidgets nbclient
	$(VENV)/view/bin/python -m tests.view_browser -o $(VENV)/view/pictures

# mypy runs no import hooks, so it cannot see the mapping of an editable installation: the links
# show it the package as it is when installed.
lint: $(INSTALLED)
	@rm -rf $(VENV)/typing && mkdir -p $(VENV)/typing/halfstep
	@ln -s "$(CURDIR)"/gpu/* "$(CURDIR)/wgsl" "$(CURDIR)/scenes" $(VENV)/typing/halfstep/
	$(PYTHON) -m ruff check
	$(PYTHON) -m ruff format --check
	$(PYTHON) -m mypy

# What ruff can mend by itself.
fix: $(INSTALLED)
	$(PYTHON) -m ruff check --fix
	$(PYTHON) -m ruff format

# Files and tables that are written from the code.
layout: $(INSTALLED)
	$(PYTHON) -m halfstep.contract.layout

tables: $(INSTALLED)
	$(PYTHON) -m tests.tables

bench: adapter
	$(PYTHON) -m halfstep bench

clean:
	rm -rf $(VENV) build dist *.egg-info gallery.png .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Any Vulkan adapter, or Mesa's driver. Where that cannot be installed, `doctor` says what to do.
adapter: $(INSTALLED)
	@$(PYTHON) -c 'from halfstep.device.adapters import list_adapters; \
	    raise SystemExit(not list_adapters())' \
	    || { $(call apt_install,mesa-vulkan-drivers); } || true
	@$(PYTHON) -m halfstep doctor

# The driver that the tests compare with bit for bit, also where there is a graphics card.
lavapipe: $(INSTALLED)
	@$(PYTHON) -c 'from halfstep.device.adapters import is_lavapipe, list_adapters; \
	    raise SystemExit(not any(map(is_lavapipe, list_adapters())))' \
	    || { $(call apt_install,mesa-vulkan-drivers); } || true
	@HALFSTEP_EXPECT_LAVAPIPE=1 $(PYTHON) -m halfstep doctor

swiftshader: $(INSTALLED)
	@[ -e $(SWIFTSHADER) ] || { $(call apt_install,libvulkan1 chromium-common); } || true
	@$(ON_SWIFTSHADER) $(PYTHON) -m halfstep doctor

# Debian and Ubuntu keep ensurepip in a package of its own.
$(INSTALLED): pyproject.toml
	@for python in python3 python3.14 python3.13 python3.12 python3.11; do \
	    $$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && break; \
	    python=; \
	done; \
	if [ -z "$$python" ]; then \
	    echo 'Halfstep needs Python 3.11 or newer, and there is none on the PATH' >&2; exit 1; \
	fi; \
	$$python -c 'import ensurepip, venv' 2>/dev/null || { \
	    package=$$($$python -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])'); \
	    $(call apt_install,$$package); \
	} || exit 1; \
	$$python -m venv --clear $(VENV)
	$(PYTHON) -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

# $(call apt_install,PACKAGE); elsewhere than on Debian and Ubuntu it says what is missing. A
# package list that cannot be fetched matters only if the package is not in the others.
apt_install = \
	if ! command -v apt-get >/dev/null; then \
	    echo "$(1) is missing here, and there is no apt-get to install it with" >&2; false; \
	else \
	    echo "installing $(1)"; \
	    root=; [ "$$(id -u)" -eq 0 ] || root=sudo; \
	    $$root apt-get update -qq || true; \
	    $$root env DEBIAN_FRONTEND=noninteractive \
	        apt-get install -qq --no-install-recommends $(1); \
	fi
