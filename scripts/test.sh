#!/usr/bin/env bash
# Run the tests of the built package in two processes; arguments are passed to pytest.
#
# Needs a sourced environment: scripts/setup.sh --dev -- scripts/test.sh does that.
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit
python evidence/harness/kernels.py && exec pytest -n 2 --dist loadfile "$@"
