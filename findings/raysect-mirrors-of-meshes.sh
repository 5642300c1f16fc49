#!/usr/bin/env bash
# raysect 0.9.1: a mirror that is a `Mesh` of two triangles loses light, since some of the rays that it reflects meet it
# again: vertices are float32. Turned by 14 degrees, 5.5 from the eye, it shows 0.990 of a lamp of radiance 1 whose
# image fills the view; the same mirror as a face of a `Box` shows 1. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install -q --disable-pip-version-check raysect==0.9.1 numpy==2.4.6
cd "$work"
MPLBACKEND=Agg "$work/venv/bin/python" - <<'END'
import numpy as np
from raysect.core import Point3D, Vector3D, rotate_basis, rotate_y, translate
from raysect.core.math.random import seed
from raysect.core.workflow import SerialEngine
from raysect.optical import ConstantSF, World
from raysect.optical.material import Conductor, UniformSurfaceEmitter
from raysect.optical.observer import PinholeCamera, PowerPipeline2D
from raysect.primitive import Box, Mesh, Sphere

SILVER = Conductor(ConstantSF(1e-9), ConstantSF(1.0))  # reflects all
PLACE = translate(0, 0, -5.5) * rotate_y(14)
SQUARE = [Point3D(x, y, 0).transform(PLACE) for x, y in ((-1.2, -1.2), (1.2, -1.2), (1.2, 1.2), (-1.2, 1.2))]
CORNERS = np.array([[p.x, p.y, p.z] for p in SQUARE])
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])


def seen(mirror):
    """What the middle of a mirror shows of a lamp all around."""
    world = World()
    kept = [Sphere(50.0, world, material=UniformSurfaceEmitter(ConstantSF(1.0), 1.0)), mirror(world)]
    pipeline = PowerPipeline2D(display_progress=False, accumulate=False)
    turned = rotate_basis(Vector3D(0, 0, -1), Vector3D(0, 1, 0))
    camera = PinholeCamera((4, 4), fov=1, pipelines=[pipeline], parent=world, transform=turned)
    camera.pixel_samples, camera.spectral_bins, camera.quiet = 20000, 1, True
    camera.min_wavelength, camera.max_wavelength = 500, 501
    camera.ray_max_depth = camera.ray_extinction_min_depth = 2  # no roulette; once mirrored, then the lamp
    camera.render_engine = SerialEngine()
    camera.observe()
    return float(pipeline.frame.mean.mean())


seed(1)
box = seen(lambda world: Box(Point3D(-1.2, -1.2, -0.1), Point3D(1.2, 1.2, 0), world, PLACE, SILVER))
flat = {"smoothing": False, "closed": False, "material": SILVER}
mesh = seen(lambda world: Mesh(CORNERS, TRIANGLES, parent=world, **flat))
print(f"the mirror shows {box:.4f} as a box, {mesh:.4f} as a mesh")
assert abs(box - 1) < 1e-3
assert mesh < 0.995
END
echo "as described"
