#!/usr/bin/env bash
# Check the sources with all of: package.xml, ruff, mypy, bandit. The exit status is 1 if one of them fails.
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit
unset PYTHONPATH  # check the sources, not the installed copy
failed=()

check_package_xml() {
  if command -v xmllint >/dev/null; then
    xmllint --noout package.xml || return
  else
    echo 'xmllint is not installed: only catkin_pkg parses package.xml'
  fi
  python - <<'PYTHON'
from catkin_pkg.package import parse_package

warnings = []
parse_package('package.xml', warnings=warnings)
print('\n'.join(warnings) or 'package.xml is valid')
raise SystemExit(bool(warnings))
PYTHON
}

echo '== package.xml'
check_package_xml || failed+=(package.xml)
echo '== ruff'
ruff check . || failed+=(ruff)
echo '== mypy'
mypy manta_sim_ros || failed+=(mypy)
echo '== bandit'  # of what is installed; each exception is justified where it is made
bandit --quiet --recursive manta_sim_ros launch setup.py || failed+=(bandit)

if [ ${#failed[@]} -gt 0 ]; then
  echo "lint: failed: ${failed[*]}"
  exit 1
fi
echo 'lint: passed'
