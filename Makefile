# `make demo` and `make test` need git, make and Python 3.11 or 3.12; all else they set up in .venv.

VENV := .venv
BIN := $(VENV)/bin
OUT := out/demo

# A sourced ROS 2 Jazzy is used; without one, its wheels are installed from the package index.
ifeq ($(and $(filter jazzy,$(ROS_DISTRO)),$(AMENT_PREFIX_PATH)),)
  ROS := wheels
  EXTRAS := robot,ros,design,view,test,lint
  CANDIDATES := python3.12 python3.11 python3
  export AMENT_PREFIX_PATH := $(CURDIR)/$(VENV)
  # Nothing of another environment: these would bring in its libraries or another middleware.
  unexport LD_LIBRARY_PATH PYTHONPATH RMW_IMPLEMENTATION _ROS_WHEELS_BOOTSTRAP_COMPLETE
else
  ROS := system
  EXTRAS := robot,design,view,test,lint
  CANDIDATES := python3 python3.12 python3.11
  export AMENT_PREFIX_PATH := $(CURDIR)/$(VENV):$(AMENT_PREFIX_PATH)
endif

# Tried by running it, since a version manager's python3.12 may be there and refuse to start.
SUITS := import ensurepip, sys, venv; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 12)))
PYTHON = $(firstword $(foreach p,$(CANDIDATES),$(shell $(p) -c '$(SUITS)' 2>/dev/null && echo $(p))))

# What is run is what was installed, although the checkout is the current folder.
export PYTHONSAFEPATH := 1

PIP := $(BIN)/python -m pip --disable-pip-version-check
# With the folders, so that a deleted file counts as a change, too.
SOURCES := $(shell find emir_* resource -not -path '*__pycache__*')

.PHONY: help install demo test lint clean

help:
	@echo 'make demo     lift and lower the boom in closed loop, record it, report on it'
	@echo 'make test     run the tests; make test ARGS="-k name" runs some of them'
	@echo 'make lint     check style and types'
	@echo 'make install  set up .venv only'
	@echo 'make clean    remove .venv, build output and the demo'

install: $(VENV)/installed

$(VENV)/made-for-$(ROS):
	$(if $(PYTHON),,$(error Python 3.11 or 3.12 with its venv module is needed: none of $(CANDIDATES) is that))
	$(PYTHON) -m venv --clear $(if $(filter system,$(ROS)),--system-site-packages) $(VENV)
	@touch $@

$(VENV)/dependencies: $(VENV)/made-for-$(ROS) setup.py
	@echo 'Installing what EMIR depends on; this takes a minute or two.'
	$(PIP) install '.[$(EXTRAS)]'
	@touch $@

$(VENV)/installed: $(VENV)/dependencies $(SOURCES) setup.cfg package.xml pyproject.toml
	@rm -rf build/lib build/bdist.* *.egg-info # else a deleted module is installed again
	$(PIP) install --quiet --no-deps --force-reinstall .
	@touch $@

demo: install
	@rm -rf $(OUT) $(OUT).json $(OUT).html
	$(BIN)/emir run --controller cascade --trajectory lift-lower --lockstep --bag $(OUT)
	$(BIN)/emir analyze $(OUT) --json $(OUT).json --html $(OUT).html
	@echo
	@echo 'Recording  $(CURDIR)/$(OUT)'
	@echo 'Report     $(CURDIR)/$(OUT).html'
	@echo 'Figures    $(CURDIR)/$(OUT).json'

# On all cores, up to four; each file's tests in one process, since they share what takes long to make.
# In the order they stand: sorted by the number of tests, files with few but long ones would end last.
test: install
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder $(ARGS)

lint: install
	$(BIN)/python -m ruff check .
	$(BIN)/python -m ruff format --check .
	$(BIN)/python -m mypy

clean:
	rm -rf $(VENV) build dist *.egg-info $(OUT) $(OUT).json $(OUT).html
