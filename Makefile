# Each target sets up what it needs first: the first time about a minute, later at once. See scripts/setup.sh.
#
#   ROS=kilted|jazzy   the ROS 2 distribution (kilted, or the one that is sourced)
#   PYTHON=...         the interpreter to make the virtual environment with
#   DURATION=20        seconds of `make sim` (until Ctrl-C)
#   PYTEST_ARGS='...'  more arguments for pytest ('-n 0': all tests in one process, for --pdb or -s)

export ROS PYTHON DURATION
VENV := $(if $(filter-out kilted,$(ROS)),.venv-$(ROS),.venv)

.PHONY: help sim test lint bench verify paper setup clean

help:  ## say what there is
	@sed -n 's/^\([a-z]*\):.*## /\1\t/p' $(firstword $(MAKEFILE_LIST)) | expand -t 8
	@sed -n 's/^#   //p' $(firstword $(MAKEFILE_LIST))

sim:  ## swim: straight, then a turn
	@scripts/setup.sh -- scripts/sim.sh

test:  ## run every test on the built package, in two processes
	@env -u ROS_DOMAIN_ID scripts/setup.sh --dev -- pytest -n 2 --dist loadfile $(PYTEST_ARGS)

lint:  ## ruff, mypy, package.xml
	@scripts/setup.sh --dev --no-build -- scripts/lint.sh

bench:  ## compare the speed with Pinocchio, MuJoCo and plain NumPy
	@env -u ROS_DOMAIN_ID scripts/setup.sh --dev -- python -m evidence.benchmark

verify:  ## prove the physics: docs/verification.md and its plots anew, about five minutes
	@scripts/setup.sh --dev -- python -m evidence.verification

paper:  ## draw the paper's figures: docs/paper.md, its plots and animations anew, about two minutes
	@scripts/setup.sh --dev -- python -m evidence.paper

setup:  ## make the virtual environment and build the package, with all tools
	@scripts/setup.sh --dev
	@echo "ready: source $(VENV)/env.sh"

clean:  ## remove all that was made, the virtual environments too
	rm -rf build install log .venv .venv-* .venv*.lock .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
