#!/usr/bin/env bash
# Mitsuba 3.9.1, integrators `volpath` and `volpathmis`: a sky and a sun light a fog without end, as brightly as the scene is
# small. No light comes an endless way through fog, so that all of it is black; but shadow rays to a sky or a sun end at a
# distance of twice the radius of a sphere around the scene's shapes, and the fog behind is forgotten. A camera within fog of
# sigma_t 1 sees 0.16 of a sky of 1 with no shape, and 0.003 with a ball of radius 0.5 that is behind it.
# Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 numpy==2.4.6
venv/bin/python - <<'END'
import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
LIGHTS = {
    "sky": {"type": "constant", "radiance": 1.0},
    "sun": {"type": "directional", "direction": [0, 0, -1], "irradiance": 1.0},
}


def brightness(integrator, light, radius):
    """radius: of a ball behind the camera, 0 for none."""
    ball = {"type": "sphere", "center": [0, -4 * radius, 0], "radius": radius}
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": integrator, "max_depth": 2},
        "fog": {"type": "homogeneous", "sigma_t": 1.0, "albedo": 1.0},
        "sensor": {
            "type": "perspective", "fov": 20, "medium": {"type": "ref", "id": "fog"},
            "to_world": mi.ScalarTransform4f().look_at([0, 0, 0], [0, 1, 0], [0, 0, 1]),
            "film": {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": 4096},
        },
        "light": LIGHTS[light],
        **({"ball": ball} if radius else {}),
    })
    return float(np.array(mi.render(scene))[..., :3].mean())


for integrator in ("volpath", "volpathmis"):
    for light in LIGHTS:
        found = [brightness(integrator, light, radius) for radius in (0, 0.5, 10)]
        print(f"{integrator}, {light}; no shape, a ball of radius 0.5, of radius 10:", found)
        assert found[0] > 20.0 * found[1] > 0.0 and found[2] < 1e-6
        assert light != "sky" or abs(found[0] - 0.164) < 0.01
END
