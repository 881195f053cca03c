# What scripts/sim.sh and scripts/swim.sh have in common; they source it. It needs a sourced environment.
# With job control each node has its own process group: Ctrl-C reaches only the script, which ends the nodes.
set -um

say() { printf '%s\n' "manta_sim_ros: $*"; }
fail() { stop; say "$*" >&2; exit 1; }

# End the nodes that still run: SIGTERM once a second, and SIGKILL after ten seconds.
stop() {
  local running tenth
  trap '' INT TERM HUP
  exec 3>&2 2>/dev/null  # without the messages of the shell about ended jobs
  for tenth in {1..100}; do
    running=$(jobs -pr)
    [ -n "$running" ] || break
    ((tenth % 10 != 1)) || kill -TERM $running
    sleep 0.1
  done
  running=$(jobs -pr)
  [ -z "$running" ] || { say "killed, as SIGTERM did not end them:" $running >&3; kill -KILL $running; }
  wait
  exec 2>&3 3>&-
}

running() { kill -0 "$1" 2>/dev/null; }

# Fail unless the variable $1 is the name of a .yaml file in the folder $2.
check_name() {
  local name=${!1} names
  [[ $name == */* || ! -f $2/$name.yaml ]] || return 0
  names=("$2"/*.yaml)
  names=("${names[@]##*/}")
  fail "$1 is $name, but must be one of: ${names[*]%.yaml}"
}

prefix=${COLCON_PREFIX_PATH:?source .venv/env.sh first}
prefix=${prefix%%:*}/manta_sim_ros
programs=$prefix/lib/manta_sim_ros
configs=$prefix/share/manta_sim_ros/config
