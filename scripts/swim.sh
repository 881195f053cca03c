#!/usr/bin/env bash
# Swim a mission with sim_node and path_follower as separate processes, as fast as the machine allows, and draw it.
# MISSION is the name of a file in config/missions/, without .yaml, or the path of a mission file: helix is the default.
# CONFIG is the name of a file in config/ with the parameters of sim_node, without .yaml: freshwater is the default.
# CURRENT is the velocity of the water, such as 0,0.1,0 in m/s. OUTPUT is the PNG file: build/swim_MISSION.png by default.
#
# Needs a sourced environment: scripts/setup.sh -- scripts/swim.sh does that. Exit status 0, or 1 if the track was lost or
# a node failed.
. "$(dirname "${BASH_SOURCE[0]}")/nodes.sh"

: "${CONFIG:=freshwater}" "${MISSION:=helix}" "${CURRENT:=}"
check_name CONFIG "$configs"
config=$configs/$CONFIG.yaml
if [[ $MISSION == */* ]]; then
  [ -f "$MISSION" ] || fail "MISSION is $MISSION, but there is no such file"
  mission=$MISSION
else
  check_name MISSION "$configs/missions"
  mission=$configs/missions/$MISSION.yaml
fi
name=${mission##*/}
: "${OUTPUT:=build/swim_${name%.yaml}.png}"
mkdir -p "$(dirname "$OUTPUT")" || fail "OUTPUT is $OUTPUT, but its folder cannot be made"

simulator=(--params-file "$config" -p start_paused:=true -p step_duration:=0.1)
if [ -n "$CURRENT" ]; then
  number='-?[0-9]+(\.[0-9]+)?'
  [[ $CURRENT =~ ^$number,$number,$number$ ]] ||
    fail "CURRENT is $CURRENT, but must be three numbers in m/s, such as 0,0.1,0"
  simulator+=(-p "water.current:=[$(sed -E 's/(^|,)(-?[0-9]+)(,|$)/\1\2.0\3/g; s/(^|,)(-?[0-9]+)(,|$)/\1\2.0\3/g' <<<"$CURRENT")]")
fi
follower=(-p use_sim_time:=true -p "mission:=$mission" -p "robot:=$config")
gains=$configs/path_follower_$CONFIG.yaml  # without one, the defaults
[ ! -f "$gains" ] || follower+=(--params-file "$gains")

say "mission: $mission; parameters: config/$CONFIG.yaml; current: ${CURRENT:-as there}"
trap 'stop; exit 0' INT TERM HUP
"$programs/sim_node" --ros-args "${simulator[@]}" &
simulator=$!
"$programs/path_follower" --ros-args "${follower[@]}" &
follower=$!
"$programs/track_node" --ros-args -p use_sim_time:=true -p lockstep:=true -p "output:=$OUTPUT" &
track=$!

wait -n "$simulator" "$follower" "$track"
if running "$track"; then
  running "$simulator" || { wait "$simulator"; fail "sim_node ended with exit status $?"; }
  wait "$follower"
  fail "path_follower ended with exit status $?"
fi
wait "$track"
status=$?
stop
exit "$status"
