#!/usr/bin/env bash
# The example of docs/identify.md: two swims of a robot with hidden values, a fit, a third swim, and gaits to try next.
set -euo pipefail
folder=${1:?the folder to write to}
here=$(dirname "$0")
free='body.quadratic_damping[5],fin.drag_coefficient'

swim() {  # name, gait, seed of the noise
  sed "s/seed: 0/seed: $3/" "$here/robot.yaml" >"$folder/$1.yaml"
  simulate --config "$folder/$1.yaml" --duration 8 --output "$folder/$1" --gait "$2"
}
swim turn 30,30,0.6,0.6,40,0 1
swim straight 25,25,0.8,0.8,30,30 2
swim other 20,35,0.5,0.5,20,40 3

identify "$folder/turn" "$folder/straight" --config "$here/start.yaml" --free "$free" \
  --channels position,orientation,twist,imu_orientation,angular_velocity,specific_force \
  --validate "$folder/other" --output "$folder/fitted.yaml" --plot "$folder/fitted.png"
identify --design 2 --config "$here/start.yaml" --free "$free"
