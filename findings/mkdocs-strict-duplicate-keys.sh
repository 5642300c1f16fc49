#!/usr/bin/env bash
# MkDocs 1.6.1: `mkdocs build --strict` passes on a mkdocs.yml that has the key `extra_css` twice. The later list wins,
# the first one's style sheet is copied to the site and linked from no page. Seen on 2026-11-28.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mkdocs==1.6.1
mkdir docs
echo "# Page" > docs/index.md
touch docs/first.css docs/second.css
printf 'site_name: Site\nextra_css: [first.css]\nextra_css: [second.css]\n' > mkdocs.yml
venv/bin/mkdocs build --strict -q
ls site/*.css
grep -o '[a-z]*\.css' site/index.html | sort -u
test -f site/first.css
! grep -q 'first\.css' site/index.html
grep -q 'second\.css' site/index.html
