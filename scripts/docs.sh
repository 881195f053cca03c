#!/usr/bin/env bash
# Check that the tables of docs/ are those of the code, and build the site; a dead link fails the build.
#
# Needs a sourced environment: scripts/setup.sh --dev -- scripts/docs.sh does that.
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit
python -m evidence.tables --check || exit
export NO_MKDOCS_2_WARNING=1 DISABLE_MKDOCS_2_WARNING=true  # a notice of the theme about another program
python -m mkdocs build --strict || exit  # --quiet would also lose the warnings that must fail the build
echo 'docs: the site is in site/index.html'
