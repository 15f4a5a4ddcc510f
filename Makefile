# `make help` lists the targets. Everything runs in .venv, which `make install` (implied) creates.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
GPSIM := $(BIN)/gpsim
# Settings for any stage target, as: make fit-gp ARGS="gp.n_train=500 seed=3"
ARGS ?=
STAGES := train-source collect build-residuals diagnose fit-gp train-gp-policy certify evaluate

.DEFAULT_GOAL := help
.PHONY: help install run run-limo smoke prove report $(STAGES) test coverage test-slow test-attacks test-cluster lint unused format types docs bench wheel clean

help:            ## List the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  %-16s %s\n", $$1, $$2}'
	@echo "  $(STAGES)"
	@echo "                   One stage each; settings in ARGS, as: make fit-gp ARGS=\"gp.n_train=500 seed=3\""

# Not compiled ahead: what runs is when it first does, a small part of what torch and the others bring.
install: $(VENV)/.installed  ## Make .venv and install gpsim into it

$(VENV)/.installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "error: gpsim needs Python 3.11 or newer, $(PYTHON) is older; set PYTHON=..."; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	@# setuptools warns of every editable installation, which reads like an error.
	PYTHONWARNINGS=ignore $(BIN)/python -m pip install --quiet --no-compile --constraint constraints.txt --editable '.[test]'
	@touch $@

prove: install   ## Concealed worlds, diagnosed blind: ARGS="--trials 40 --seed 1 --out runs/proof-1"
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[prove]'
	$(GPSIM) prove $(or $(ARGS),--trials 40 --seed 1 --out runs/proof-1)

run: install     ## The full CartPole loop: train, collect, learn the residual, train again, evaluate, report
	$(GPSIM) run full-loop experiment=cartpole $(ARGS)

run-limo: install  ## The full Limo loop: a car's bag, its corrected simulators, policies that reach a goal
	$(GPSIM) run full-loop experiment=limo $(ARGS)

smoke: install   ## Both whole loops on a tiny budget, under a minute each
	$(GPSIM) run full-loop experiment=cartpole budget=smoke $(ARGS)
	$(GPSIM) run full-loop experiment=limo budget=smoke $(ARGS)

report: install  ## Tables and HTML page of a finished loop
	$(GPSIM) report experiment=cartpole $(ARGS)

$(STAGES): install
	$(GPSIM) $@ $(ARGS)

# Types are checked beside the tests: by itself that keeps one core busy for a minute, and the others idle.
test: install lint  ## Tests, ruff and strict types
	@$(BIN)/mypy & typed=$$!; $(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder; \
	  tested=$$?; wait $$typed && exit $$tested

coverage: install  ## Which lines of gpsim/ and cli/ the tests run: a table, and build/coverage/
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[coverage]'
	mkdir -p build
	COVERAGE_FILE=$(CURDIR)/build/.coverage $(BIN)/python -m pytest -n auto --dist loadfile --cov gpsim --cov cli \
	  --cov-report term:skip-covered --cov-report html:build/coverage

test-slow: install  ## The heavy tests, minutes each
	$(BIN)/python -m pytest -m slow -n auto --dist load

test-attacks: install  ## Hostile files, hundreds of them, the slow ones among them
	$(BIN)/python -m pytest -m "not cluster" -n auto --dist load tests/attacks

test-cluster: install  ## A real SLURM on this machine: jobs, workers and schedulers killed (Debian: slurm-wlm, munge)
	$(BIN)/python -m pytest -m cluster tests/cluster

lint: install    ## ruff: style and format; plain words in pages and messages
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python docs/plain_words.py

unused: install  ## Code and dependencies that nothing uses (vulture, deptry)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[unused]'
	$(BIN)/vulture
	$(BIN)/deptry gpsim cli

format: install  ## Let ruff format the code
	$(BIN)/ruff check --fix-only --quiet .
	$(BIN)/ruff format .

types: install   ## mypy, strict
	$(BIN)/mypy

bench: install   ## Speed, side by side with other libraries
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[benchmark]'
	$(BIN)/python benchmarks/gp_speed.py
	$(BIN)/python benchmarks/training_speed.py
	$(BIN)/python benchmarks/sac_speed.py

docs: install    ## The site of docs/ into build/site; broken links are errors
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[docs]'
	$(BIN)/python docs/generate.py
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

wheel: install   ## Build the wheel into dist/
	$(BIN)/python -m build --wheel

clean:           ## Remove the environment and everything built; artifacts in runs/ stay
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache
