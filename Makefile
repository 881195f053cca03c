# Each target first sets up what it needs: the first time this takes about a minute. See scripts/setup.sh.
#
#   ROS=kilted|jazzy   the ROS 2 distribution (default: kilted, or the one that is sourced)
#   PYTHON=...         the interpreter that the virtual environment is made with
#   CONFIG=freshwater  the file config/$(CONFIG).yaml with the parameters of `make sim` (default: manta) and `make swim` (freshwater)
#   MISSION=helix      the file config/missions/$(MISSION).yaml, or a path, that `make swim` swims
#   CURRENT=0,0.1,0    velocity of the water of `make swim` in m/s
#   DURATION=20        simulated seconds of `make sim` (default: until Ctrl-C)
#   PYTEST_ARGS='...'  further arguments for pytest, such as '-k gait' or a folder ('-n 0' runs all in one process)

export ROS PYTHON CONFIG DURATION MISSION CURRENT
VENV := $(if $(filter-out kilted,$(ROS)),.venv-$(ROS),.venv)
TOOLS := @scripts/setup.sh --dev
PYTEST_ARGS ?=

.PHONY: help sim swim study linearize sweep identify test colcon-test lint docs tables bench steering control-report \
  train verify paper validate soak setup clean

help:  ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(firstword $(MAKEFILE_LIST)) | expand -t 16
	@sed -n 's/^#   //p' $(firstword $(MAKEFILE_LIST))

sim:  ## watch the robot swim straight ahead and then turn
	@scripts/setup.sh -- scripts/sim.sh

swim:  ## swim a mission along a path, faster than real time: writes build/swim_helix.png, see docs/control.md
	@scripts/setup.sh -- scripts/swim.sh

study:  ## simulate a swim faster than real time, and make a page of it: writes study/, see docs/studies.md
	@rm -rf study
	@scripts/setup.sh -- simulate --config config/freshwater.yaml --commands docs/studies/straight_then_turn.csv \
	  --duration 20 --output study/run --fin-joints
	@scripts/setup.sh --no-build -- report study/run --output study/report.html
	@echo 'open study/report.html in a browser'

linearize:  ## linearize a cruise in fresh water: modes, time constants, A and B
	@scripts/setup.sh -- linearize --config config/freshwater.yaml --gait 30,30,0.5,0.5,40,40

sweep:  ## simulate the study config/studies/amplitude_and_phase.yaml: writes build/sweep.parquet and build/sweep.png
	@scripts/setup.sh -- sweep config/studies/amplitude_and_phase.yaml \
	  --output build/sweep.parquet --plot build/sweep.png

identify:  ## fit two hidden parameters to noisy swims, the example of docs/identify.md: writes build/identify/
	@rm -rf build/identify && mkdir -p build/identify
	@scripts/setup.sh -- docs/identify/example.sh build/identify

train:  ## train a policy that swims to targets, the example of docs/learning.md: writes build/policy.json
	@mkdir -p build
	@scripts/setup.sh --test -- train_policy --output build/policy.json

test:  ## run all tests on the built package, in two processes
	@env -u ROS_DOMAIN_ID scripts/setup.sh --dev -- scripts/test.sh $(PYTEST_ARGS)

colcon-test:  ## run the tests with colcon test; those that need Pinocchio or MuJoCo are skipped without them
	@env -u ROS_DOMAIN_ID scripts/setup.sh --test -- scripts/colcon_test.sh -n 2 --dist loadfile $(PYTEST_ARGS)

lint:  ## check package.xml, style (ruff), types (mypy) and security (bandit)
	$(TOOLS) --no-build -- scripts/lint.sh

docs:  ## check the tables of docs/ and build the site into site/
	$(TOOLS) -- scripts/docs.sh

tables:  ## write the tables of docs/ that come from the code
	$(TOOLS) -- python -m evidence.tables

bench:  ## compare the speed with Pinocchio, MuJoCo and NumPy: writes docs/benchmark.md
	@env -u ROS_DOMAIN_ID scripts/setup.sh --dev -- python -m evidence.benchmark

control-report:  ## measure how well the path follower follows paths: writes docs/control_report.md, about half an hour
	$(TOOLS) -- python -m evidence.control_report

steering:  ## measure what each input of the fins does: writes docs/controller.md
	$(TOOLS) -- python -m evidence.steering

verify:  ## verify the physics: writes docs/verification.md with its plots, about five minutes
	$(TOOLS) -- python -m evidence.verification

paper:  ## draw the figures of the paper: writes docs/paper.md with its plots and animations, about two minutes
	$(TOOLS) -- python -m evidence.paper

validate:  ## compare both configurations with published facts: writes docs/validation.md with its plots, about two minutes
	$(TOOLS) -- python -m evidence.validation

soak:  ## measure what the simulator survives: writes docs/reliability.md, longer than half an hour; SHORT=1, PARTS=fuzz
	@env -u ROS_DOMAIN_ID scripts/setup.sh --dev -- python -m evidence.soak $(if $(SHORT),--short) $(PARTS)

setup:  ## make the virtual environment with all tools, and build the package
	$(TOOLS)
	@echo "ready: source $(VENV)/env.sh"

clean:  ## remove everything that was made, virtual environments included
	rm -rf build install log site study .venv .venv-* .venv*.lock .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
