#!/usr/bin/env bash
# Mitsuba 3.9.1, integrators `volpath` and `volpathmis`: shadow rays in homogeneous media. (1) A lamp in a medium is
# exp(8.9e-4 tau) too bright behind the optical thickness tau: a shadow ray ends 8.9e-4 of its length short of the lamp,
# and so does the medium. (2) Whether light comes through is drawn, 1 or 0, though exp(-tau) is known: the variance of
# one sample is exp(tau) - 1 times the square of the mean, and of a lamp behind tau = 10 one sample in 22,000 sees
# anything. Here: a floor under a point lamp, both in a medium that only absorbs. Seen on 2026-11-29.
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
Transform = mi.ScalarTransform4f
EYE = 1e-3  # height of the camera, which looks down


def samples(integrator, tau, count):
    """Pictures of the floor: their mean over the right one, its error, and the variance of a sample."""
    medium = {"type": "homogeneous", "sigma_t": tau, "albedo": 0.0}
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": integrator, "max_depth": 2},
        "sensor": {
            "type": "perspective", "fov": 1, "near_clip": 1e-5, "medium": medium,
            "to_world": Transform().look_at([0, 0, EYE], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 64, "height": 64, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": 1},
        },
        "floor": {
            "type": "rectangle", "to_world": Transform().scale(10), "exterior": medium,
            "bsdf": {"type": "diffuse", "reflectance": 1.0},
        },
        "lamp": {"type": "point", "position": [0, 0, 1], "intensity": 1.0},
    })
    right = np.exp(-tau * (1.0 + EYE)) / np.pi
    one = np.array(mi.render(scene, spp=1, seed=999))[..., 0] / right
    pictures = [np.array(mi.render(scene, spp=1024, seed=k))[..., 0].mean() for k in range(count)]
    pictures = np.array(pictures) / right
    return pictures.mean(), pictures.std() / count**0.5, one.var()


for integrator in ("volpath", "volpathmis"):
    for tau in (2.0,):
        mean, error, variance = samples(integrator, tau, 8)
        print(
            f"{integrator}, tau {tau}: mean {mean:.5f} ± {error:.5f}, exp(8.9e-4 tau) "
            f"{np.exp(8.94e-4 * tau):.5f}; variance of a sample {variance:.2f}, exp(tau) - 1 "
            f"{np.exp(tau) - 1:.2f}"
        )
        assert abs(mean - np.exp(8.94e-4 * tau)) < 4 * error < 4 * 6e-4
        assert abs(variance / (np.exp(tau) - 1.0) - 1.0) < 0.2
END
