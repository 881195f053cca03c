#!/usr/bin/env bash
# Run the tests of the built package with `colcon test`, and report their results; arguments are passed to pytest.
#
# Needs a sourced environment: scripts/setup.sh --test -- scripts/colcon_test.sh does that.
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit
install_base=${COLCON_PREFIX_PATH:?source .venv/env.sh first}
install_base=${install_base%%:*}
build_base=build/${install_base##*/}
rm -f "$build_base/manta_sim_ros/pytest.xml"  # results of an earlier run
python -m colcon --log-base "$build_base/log" test --packages-select manta_sim_ros --paths . \
  --build-base "$build_base" --install-base "$install_base" --return-code-on-test-failure \
  --event-handlers console_direct+ desktop_notification- status- terminal_title- --pytest-args "$@"
status=$?
python -m colcon test-result --test-result-base "$build_base" --verbose || status=1
exit "$status"
