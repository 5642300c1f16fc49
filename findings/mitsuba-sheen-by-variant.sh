#!/usr/bin/env bash
# Mitsuba 3.9.1, `principled` with a sheen and spec_trans = 1: the scalar variants leave the sheen out, the vectorised
# ones keep it. Where spec_trans is the next number below 1, all variants have it. Of 441 pairs of parameters of
# `principled` and `principledthin`, each 0, 0.5 or 1, only those with both differ. Seen on 2026-11-28.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 numpy==2.4.6 karellen-llvm-core==19.1.7
export DRJIT_LIBLLVM_PATH="$work/venv/lib/libLLVM.so.19.1"
cat > value.py <<'END'
import sys

import mitsuba as mi
import numpy as np

mi.set_variant(sys.argv[1])
point = mi.load_dict({"type": "sphere"}).ray_intersect(mi.Ray3f([0, 0, 3], [0.1, 0, -1]))
point.wi = [0.6, 0.0, 0.8]


def value(spec_trans, sheen):
    """The BSDF times the cosine, in one channel."""
    bsdf = mi.load_dict({"type": "principled", "spec_trans": spec_trans, "sheen": sheen, "roughness": 0.5})
    found = bsdf.eval(mi.BSDFContext(), point, mi.Vector3f(-0.8, 0.0, 0.6))
    return float(np.array(found).ravel()[0])


for spec_trans in (1.0, 1.0 - 2.0**-24):
    print(f"{value(spec_trans, 1.0) / value(spec_trans, 0.0):.4f}")
END
venv/bin/python value.py scalar_rgb > scalar
venv/bin/python value.py llvm_ad_rgb > llvm
echo "with sheen over without, spec_trans = 1 and just below:" scalar: $(cat scalar) llvm: $(cat llvm)
test "$(head -1 scalar)" = 1.0000
test "$(head -1 llvm)" != 1.0000
test "$(tail -1 scalar)" = "$(tail -1 llvm)"
