#!/usr/bin/env bash
# Make the virtual environment and build the package with colcon; do only what is not done yet.
#
#   scripts/setup.sh [--test | --dev] [--no-build] [-- COMMAND ...]
#
#   --test       also install what the tests need (requirements/test.txt)
#   --dev        also install what all tests, verification, lint, benchmark and docs need (requirements/dev.txt)
#   --no-build   do not build with colcon
#   COMMAND      then run this command in that environment, on this machine only and in a ROS domain of its own
#   ROS          distribution: kilted (default) or jazzy. The environment is .venv, or .venv-$ROS for all but kilted.
#   PYTHON       interpreter to make the environment with; by default the first suitable one on the PATH
#
# ROS 2 itself is installed from pinned wheels. When a ROS 2 environment with rclpy is sourced (and is the requested
# distribution), that one is used instead, and only the Python packages that it lacks are installed.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"

say() { printf '%s\n' "manta_sim_ros: $*"; }
fail() { printf '%s\n' "manta_sim_ros: $*" >&2; exit 1; }

# Shebangs and the scripts of colcon split the path of the interpreter at spaces, and PATH and LD_LIBRARY_PATH are lists.
longest_root=220  # characters: a shebang has at most 255
case $root in
  *[[:space:]:\;\"\$\`\\*?[]*)
    fail "the path of the repository is ${root@Q}, but must have no spaces and none of : ; \" \$ \` \\ * ? [: move it" ;;
esac
[ ${#root} -le $longest_root ] ||
  fail "the path of the repository has ${#root} characters, but must have at most $longest_root: move it"

log=$(mktemp)
trap 'rm -f "$log"' EXIT

# Run a command and show its output only when it fails.
quietly() {
  "$@" >"$log" 2>&1 </dev/null || { cat "$log" >&2; return 1; }
}

tools=() build=yes
while [ $# -gt 0 ]; do
  case $1 in
    --test) tools=(requirements/test.txt) ;;
    --dev) tools=(requirements/test.txt requirements/dev.txt) ;;
    --no-build) build='' ;;
    --) shift; break ;;
    *) fail "unknown argument $1, expected --test, --dev, --no-build or -- COMMAND" ;;
  esac
  shift
done

venv=.venv
case ${ROS:-kilted} in
  kilted) ;;
  *[!a-z]*) fail "ROS=$ROS is not the name of a distribution" ;;
  *) venv=.venv-$ROS ;;
esac
python=$root/$venv/bin/python

# -- which ROS 2: the one that is sourced, or wheels

rclpy_of_the_system() {  # the environments that are made here do not count
  local file
  file=$(python3 -c 'import rclpy; print(rclpy.__file__)' 2>/dev/null) && [ "${file#"$root/"}" = "$file" ]
}

if [ -n "${ROS_DISTRO:-}" ] && [ "${ROS:-$ROS_DISTRO}" = "$ROS_DISTRO" ] && rclpy_of_the_system; then
  source=sourced distribution=$ROS_DISTRO
else
  source=wheels distribution=${ROS:-kilted}
  unset AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH ROS_DISTRO
  wheels=requirements/ros-$distribution.txt
  [ -f "$wheels" ] || fail "there are no wheels for ROS=$distribution, only for kilted and jazzy: source a ROS 2 $distribution environment first"
  case $(uname -sm) in
    'Linux x86_64') ;;
    *) fail "the ROS 2 wheels are for x86_64 Linux, this is $(uname -sm): source a ROS 2 environment first" ;;
  esac
fi
unset PYTHONHOME _ROS_WHEELS_BOOTSTRAP_COMPLETE

# -- one at a time

if command -v flock >/dev/null; then
  exec 9>"$venv.lock"
  flock -n 9 || { say "waiting for another setup of $venv to finish"; flock 9; }
fi

# -- what is there already: $venv/setup.stamp, written last, and removed before anything is changed

digest() { sha256sum | cut -c1-64; }
runtime_files=(requirements/python.txt requirements/build.txt requirements/constraints.txt)
[ "$source" = sourced ] || runtime_files+=("$wheels")
runtime_key=$({ printf '%s\n' "$root/$venv" "$source" "$distribution"
                [ "$source" = wheels ] || printf '%s\n' "${AMENT_PREFIX_PATH:-}"
                cat "${runtime_files[@]}"; } | digest)
stamp=$venv/setup.stamp
tool_key() { { echo "$runtime_key"; cat "$1"; } | digest; }

stamped() { [ -f "$stamp" ] && grep -qxF "$1" "$stamp"; }

# The interpreter behind $1 (not a virtual environment's), if it can make an environment. Status 2: only ensurepip is missing.
base_python() {
  "$1" -I -S -c '
import sys
first, last = (3, 10), (3, 13) if sys.argv[1] == "wheels" else (3, 99)
if not first <= sys.version_info[:2] <= last:
    sys.exit(1)
try:
    import ensurepip, venv
except ImportError:
    print("%d.%d" % sys.version_info[:2])
    sys.exit(2)
print(getattr(sys, "_base_executable", None) or sys.executable)' "$source" 2>/dev/null
}

find_python() {
  local candidate found status without_pip=''
  local candidates=(python3.12 python3.11 python3.13 python3.10 python3)
  [ "$source" = wheels ] || candidates=(python3)  # the one that rclpy is for
  [ -z "${PYTHON:-}" ] || candidates=("$PYTHON")
  for candidate in "${candidates[@]}"; do
    status=0
    found=$(base_python "$candidate") || status=$?
    [ "$status" -ne 0 ] || { printf '%s\n' "$found"; return; }
    [ "$status" -ne 2 ] || without_pip=${without_pip:-$found}
  done
  [ -z "$without_pip" ] || fail "Python $without_pip cannot make virtual environments: apt install python$without_pip-venv (or say PYTHON=...)"
  fail "needs Python 3.10 or later$([ "$source" = sourced ] || echo ' (the ROS 2 wheels: 3.10 to 3.13)'), none found as ${candidates[*]}: say PYTHON=..."
}

# -- the virtual environment

pip_install() {
  PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1 PIP_USER=0 quietly "$python" -m pip --quiet install "$@"
}

# The lines of the requirements files $@ whose package the environment does not have, whatever its version.
missing() {
  "$python" - "$@" <<'PYTHON'
import importlib.metadata
import re
import sys

for name in sys.argv[1:]:
    for line in open(name):
        if package := re.match(r'[A-Za-z0-9._-]+', line):
            try:
                importlib.metadata.version(package.group())
            except importlib.metadata.PackageNotFoundError:
                print(line, end='')
PYTHON
}

# Install the requirements files $@: with wheels all of them; beside a sourced ROS 2 what is not there yet, with
# numpy held where it is, as the messages are compiled against it.
install() {
  local arguments=() file constraints=requirements/constraints.txt
  if [ "$source" = sourced ]; then
    constraints=$venv/constraints.txt
    "$python" -c 'import numpy; print("numpy==" + numpy.__version__)' >"$constraints" 2>/dev/null || : >"$constraints"
    missing "$@" >"$venv/missing.txt"
    [ -s "$venv/missing.txt" ] || return 0
    set -- "$venv/missing.txt"
  fi
  for file in "$@"; do arguments+=(--requirement "$file"); done
  pip_install --constraint "$constraints" "${arguments[@]}"
}

base=
[ -z "${PYTHON:-}" ] || base=$(find_python)

lacking=()  # the tools that are not installed yet
for file in "${tools[@]}"; do
  stamped "$(tool_key "$file")" || lacking+=("$file")
done

if ! stamped "$runtime_key" || ! "$python" -I -S -c '' 2>/dev/null || ! { [ -z "$base" ] || stamped "python $base"; }; then
  [ -n "$base" ] || base=$(find_python)
  files=(requirements/python.txt requirements/build.txt "${tools[@]}")
  keys=("python $base" "$runtime_key")
  if [ "$source" = sourced ]; then
    say "making $venv on top of the sourced ROS 2 $distribution (once)"
    isolation=--system-site-packages
  else
    say "installing ROS 2 $distribution wheels into $venv (once, about a minute)"
    isolation=
    files=("$wheels" "${files[@]}")
  fi
  [ ${#tools[@]} -eq 0 ] || say "with the tools of ${tools[*]}"
  for file in "${tools[@]}"; do keys+=("$(tool_key "$file")"); done
  rm -rf "$venv" "build/$distribution" "install/$distribution"
  quietly "$base" -m venv $isolation "$venv"
  touch "$venv/COLCON_IGNORE"
  install "${files[@]}" || fail "installing into $venv failed (above)"
  printf '%s\n' "${keys[@]}" >"$stamp"
elif [ ${#lacking[@]} -gt 0 ]; then
  say "installing the tools of ${lacking[*]} into $venv (once)"
  mapfile -t keys <"$stamp"
  for file in "${lacking[@]}"; do keys+=("$(tool_key "$file")"); done
  rm -f "$stamp"
  install "${lacking[@]}" || fail "installing into $venv failed (above)"
  printf '%s\n' "${keys[@]}" >"$stamp"
fi

# -- the package

sources() {
  find package.xml setup.py setup.cfg resource config launch rviz urdf manta_sim_ros \
    -type f ! -name '*.pyc' ! -name '*.nb[ci]' -print0
}
build_key() { { echo "$runtime_key"; sources | LC_ALL=C sort -z | xargs -0 sha256sum; } | digest; }
build_stamp=install/$distribution/build.stamp
[ -z "$build" ] || key=$(build_key)
if [ -n "$build" ] && [ "$(cat "$build_stamp" 2>/dev/null)" != "$key" ]; then
  say "building the package with colcon into install/$distribution"
  rm -f "$build_stamp"
  # Remove what the last build made, so that modules that were removed do not stay; compiled kernels may stay.
  rm -rf "build/$distribution/manta_sim_ros/build"
  if [ -f "build/$distribution/manta_sim_ros/install.log" ]; then
    grep -F "$root/install/$distribution/" "build/$distribution/manta_sim_ros/install.log" | xargs -r -d '\n' rm -f
    find "install/$distribution/manta_sim_ros" -depth -type d -empty -delete  # such as the metadata of another version
  fi
  quietly "$python" -m colcon --log-base "build/$distribution/log" build --paths . \
    --build-base "build/$distribution" --install-base "install/$distribution" \
    --event-handlers console_cohesion+ desktop_notification- status- terminal_title- || fail "colcon build failed (above)"
  printf '%s\n' "$key" >"$build_stamp"
fi

# -- what to source, and what to run

setup_script=$root/install/$distribution/local_setup.bash
[ "$source" = wheels ] || setup_script=$root/install/$distribution/setup.bash  # sources the ROS 2 below it first
{
  echo "# Made by scripts/setup.sh. Source this in bash: ROS 2 $distribution and the built package."
  if [ "$source" = wheels ]; then
    echo 'unset CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH PYTHONHOME PYTHONPATH ROS_DISTRO _ROS_WHEELS_BOOTSTRAP_COMPLETE'
    printf 'export AMENT_PREFIX_PATH=%q RMW_IMPLEMENTATION=rmw_fastrtps_cpp\n' "$root/$venv"
  fi
  printf 'export PATH=%q:%q:"$PATH"\n' "$root/install/$distribution/manta_sim_ros/lib/manta_sim_ros" "$root/$venv/bin"
  echo 'export ROS_AUTOMATIC_DISCOVERY_RANGE=${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}'
  printf '[ ! -f %q ] || . %q\n' "$setup_script" "$setup_script"
} >"$venv/env.sh.new"
mv "$venv/env.sh.new" "$venv/env.sh"

[ $# -gt 0 ] || exit 0

# A domain in which nobody on this machine listens: the ports are those of the domain's first ten participants.
free_domain() {
  local domain=$(($$ % 100 + 1)) tries ports
  for tries in {1..100}; do
    ports=$(seq $((7410 + 250 * domain)) 2 $((7428 + 250 * domain)) | xargs printf ':%04X \n')
    grep -qsF "$ports" /proc/net/udp || break
    domain=$((domain % 100 + 1))
  done
  echo "$domain"
}

exec 9>&-
rm -f "$log"
set +eu
. "$venv/env.sh"
export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
export ROS_DOMAIN_ID=${ROS_DOMAIN_ID:-$(free_domain)}
exec "$@"
