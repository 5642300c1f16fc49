#!/usr/bin/env bash
# Mitsuba 3.9.1, scalar_rgb: the hit point of a `cylinder` is pushed off its surface, the further the thinner the cylinder is. Of rays from ten
# units away, which all hit, the distance `si.t` is right to 1e-6, and origin + t * direction lies on the cylinder; `si.p` is off it by 1e-7 for a
# radius of 1, but by 2e-6, 2e-5, 2e-4 and 2e-3 (medians) for 0.1, 0.01, 1e-3 and 1e-4: for the last that is twenty radii, to either side.
# The shift along the normal that is to take rounding away multiplies it by one over the radius: light and shadow rays start there.
# llvm_ad_rgb does not do that: there the point is on the ray, and the distance itself is inexact. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 drjit==1.5.0 numpy==2.4.6
cat > points.py <<'END'
import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
rng = np.random.default_rng(1)
print("radius   si.p off the cylinder  origin + t d off it   (medians of 300)")
found = {}
for radius in (1.0, 0.1, 0.01, 1e-3, 1e-4):
    scene = mi.load_dict({"type": "scene", "one": {"type": "cylinder", "radius": radius, "p0": [0, 0, -1], "p1": [0, 0, 1]}})
    off = []
    for _ in range(300):
        o = np.array([10.0, 3.0, 0.2]) + rng.uniform(-1, 1, 3)
        d = [0.0, rng.uniform(0.1, 0.9) * radius, 0.1] - o
        d /= np.linalg.norm(d)
        o, d = (x.astype(np.float32).astype(float) for x in (o, d))
        si = scene.ray_intersect(mi.Ray3f(mi.Point3f(o), mi.Vector3f(d)))
        assert si.is_valid()
        points = np.array(si.p, float), o + float(si.t) * d
        off.append([abs(np.hypot(p[0], p[1]) - radius) for p in points])
    found[radius] = np.median(off, axis=0)
    print(f"{radius:6g}   {found[radius][0]:8.1e}               {found[radius][1]:8.1e}")
assert found[1.0][0] < 5e-7
for radius in (0.1, 0.01, 1e-3, 1e-4):
    assert 5e-8 < found[radius][0] * radius < 1e-6, "the error no longer goes with one over the radius"
    assert found[radius][1] < 2e-6
assert found[1e-4][0] > 5e-4
print("as described")
END
venv/bin/python points.py
