#!/usr/bin/env bash
# OpenImageIO 3.2.2: `idiff` of a picture against one in which no value is a number prints PASS and exits with 0; so do `idiff -p`
# and `oiiotool --diff`, in either order of the two. One pixel that is 0.5 too bright, or infinite, fails. ImageBufAlgo.compare
# counts no failure and no warning either, with a largest error of nan; with only one such pixel the largest error is 0, and only
# the mean errors are nan. A gate must ask for numbers before it compares. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check OpenImageIO==3.2.2.0 numpy==2.4.6
venv/bin/python - <<'END_OF_PYTHON'
import numpy as np
import OpenImageIO

good = np.random.default_rng(1).random((16, 16, 3), dtype=np.float32)


def write(name, value, everywhere=False):
    values = good.copy()
    values[(...,) if everywhere else (3, 3)] = value
    OpenImageIO.ImageBuf(values).write(f"{name}.exr")
    return OpenImageIO.ImageBufAlgo.compare(OpenImageIO.ImageBuf(good), OpenImageIO.ImageBuf(values), 1e-6, 1e-6)


write("good", good[3, 3])
assert write("brighter", good[3, 3] + 0.5).error
assert write("infinite", np.inf).error
one, all_of_them = write("one", np.nan), write("none", np.nan, everywhere=True)
for found in one, all_of_them:
    print("compare:", found.error, "fail", found.nfail, "warn", found.nwarn, "largest", found.maxerror, "mean", found.meanerror)
    assert not found.error and found.nfail == found.nwarn == 0 and np.isnan(found.meanerror)
assert one.maxerror == 0.0
END_OF_PYTHON
for name in good one none brighter infinite; do
  for command in "idiff good.exr $name.exr" "idiff $name.exr good.exr" "idiff -p good.exr $name.exr" "oiiotool --diff good.exr $name.exr"; do
    code=0
    venv/bin/$command > said || code=$?
    echo "$command: $(grep -oE '^(PASS|WARNING|FAILURE)$' said), exit code $code"
  done
done | tee seen
test "$(grep -cE "(good|one|none).exr: PASS, exit code 0$" seen)" = 12
test "$(grep -E "brighter|infinite" seen | grep -c "FAILURE, exit code [12]$")" = 7
grep -q "^idiff -p good.exr infinite.exr: PASS, exit code 0$" seen
