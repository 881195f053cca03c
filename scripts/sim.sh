#!/usr/bin/env bash
# Run the built sim_node, gait_node and monitor_node as separate processes until Ctrl-C, SIGTERM or the end of DURATION.
# CONFIG is the name of a file in config/ with the parameters of sim_node, without .yaml: manta is the default.
#
# Needs a sourced environment: scripts/setup.sh -- scripts/sim.sh does that. Exit status 0, or 1 if a node failed.
. "$(dirname "${BASH_SOURCE[0]}")/nodes.sh"

: "${CONFIG:=manta}"
check_name CONFIG "$configs"
config=$configs/$CONFIG.yaml

monitor_arguments=(-p use_sim_time:=true)
if [ -n "${DURATION:-}" ]; then
  [[ $DURATION =~ ^[0-9]+(\.[0-9]+)?$ ]] || fail "DURATION is $DURATION, but must be a number of seconds"
  [[ $DURATION =~ [1-9] ]] || fail "DURATION is $DURATION, but must be greater than 0"
  [[ $DURATION == *.* ]] || DURATION+=.0
  monitor_arguments+=(-p "duration:=$DURATION")
fi

say "parameters: config/$CONFIG.yaml"
say "ROS_DOMAIN_ID=${ROS_DOMAIN_ID:-0} (export it in another terminal to watch or to command the robot); Ctrl-C ends it"
trap 'stop; exit 0' INT TERM HUP
"$programs/sim_node" --ros-args --params-file "$config" &
sim=$!
"$programs/gait_node" --ros-args -p use_sim_time:=true &
gait=$!
"$programs/monitor_node" --ros-args "${monitor_arguments[@]}" &
monitor=$!

watched=("$sim" "$gait" "$monitor")
while :; do
  wait -n "${watched[@]}"
  running "$sim" || { wait "$sim"; fail "sim_node ended with exit status $?"; }
  if ! running "$monitor"; then
    wait "$monitor" || fail "monitor_node ended with exit status $?"
    stop
    exit 0
  fi
  if ! running "$gait"; then  # its list may have ended
    wait "$gait" || fail "gait_node ended with exit status $?"
    watched=("$sim" "$monitor")
  fi
done
