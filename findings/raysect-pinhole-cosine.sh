#!/usr/bin/env bash
# raysect 0.9.1: `PinholeCamera` multiplies what a pixel sees by the cosine between its ray and the direction of view. Under
# an even sky of radiance 1 a picture of 90 degrees shows 1 in the middle and 0.59 in the corners, 1 / sqrt(1 + x^2 + y^2).
# The angle of view spans the longer side, so that a picture of twice the height shows less across. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -q --disable-pip-version-check raysect==0.9.1 numpy==2.4.6
cd "$work"
MPLBACKEND=Agg "$work/venv/bin/python" - <<'END'
import numpy as np
from raysect.core import Point3D
from raysect.core.workflow import SerialEngine
from raysect.optical import ConstantSF, World
from raysect.optical.material import UniformSurfaceEmitter
from raysect.optical.observer import PinholeCamera, PowerPipeline2D
from raysect.primitive import Box, Sphere


def picture(world, size):
    """(height, width), seen along z with one wavelength's nanometre."""
    pipeline = PowerPipeline2D(display_progress=False, accumulate=False)
    camera = PinholeCamera(size, fov=90, pipelines=[pipeline], parent=world)
    camera.pixel_samples, camera.spectral_bins, camera.quiet = 64, 1, True
    camera.min_wavelength, camera.max_wavelength = 500, 501
    camera.render_engine = SerialEngine()
    camera.observe()
    return np.array(pipeline.frame.mean).T


LAMP = UniformSurfaceEmitter(ConstantSF(1.0), 1.0)
world = World()
sky = Sphere(100.0, world, material=LAMP)
seen = picture(world, (32, 32))
x = (np.arange(32) + 0.5) / 16 - 1
cosine = 1 / np.sqrt(1 + x**2 + x[:, None] ** 2)
print("middle", seen[15:17, 15:17].mean().round(4), "corner", seen[0, 0].round(4), "cosine there", cosine[0, 0].round(4))
assert np.abs(seen - cosine).max() < 0.02
widths = []
for size in ((32, 32), (32, 64)):
    world = World()
    wall = Box(Point3D(-0.5, -0.5, 1), Point3D(0.5, 0.5, 1.1), world, material=LAMP)
    widths.append((picture(world, size) > 0.4).sum(axis=1).max())
print("columns that a wall of a width of 1 at distance 1 fills:", *widths, "of 32")
assert widths == [16, 32]
END
