#!/usr/bin/env bash
# raysect 0.9.1 (float64): hits that are not on the torus, where a small one is seen from some distance. Of the rays that are
# aimed at the inside of the tube from a distance of 2, a quarter have no hit on a torus of radii 0.01 and 0.002, or one that
# is off its surface by more than a hundredth of the tube; nearly all on one of 0.004 and 0.001, and none on one of 0.1 and
# 0.02. Of tori that are a thousand times as large, and as far away, none is wrong: an absolute epsilon, which a scene
# in millimetres does not meet and one in metres does. Seen on 2026-11-28.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check raysect==0.9.1 numpy==2.4.6 matplotlib==3.10.7
cat > tori.py <<'END'
import math

import numpy as np
from raysect.core import Point3D, Ray, Vector3D, World
from raysect.primitive import Torus


def wrong(major, minor, distance, count=4000):
    """The share of rays towards points within the tube whose hit is not on its surface."""
    world, rng, found = World(), np.random.default_rng(1), 0
    torus = Torus(major, minor)
    torus.parent = world
    for _ in range(count):
        phi, theta, inside = rng.uniform(0.0, 1.0, 3) * [2.0 * math.pi, 2.0 * math.pi, minor]
        around, up = major + inside * math.cos(theta), inside * math.sin(theta)
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        start = np.array([around * math.cos(phi), around * math.sin(phi), up]) + distance * way
        hit = world.hit(Ray(Point3D(*start), Vector3D(*-way)))
        if hit is None:
            found += 1
            continue
        x, y, z = start - hit.ray_distance * way
        found += abs(math.hypot(math.hypot(x, y) - major, z) - minor) > 0.01 * minor
    return found / count


for scale in (1.0, 1000.0):
    for major, minor in ((0.1, 0.02), (0.01, 0.002), (0.004, 0.001)):
        share = wrong(scale * major, scale * minor, scale * 2.0)
        print(f"scale {scale:g}, radii {major:g} and {minor:g}: wrong {share:.2f}")
END
venv/bin/python tori.py > seen
cat seen
grep -q "^scale 1, radii 0.1 and 0.02: wrong 0.00$" seen
grep -q "^scale 1, radii 0.01 and 0.002: wrong 0.[1-4]" seen
grep -q "^scale 1, radii 0.004 and 0.001: wrong 0.9" seen
test "$(grep -c "^scale 1000, .*: wrong 0.00$" seen)" = 3
