#!/usr/bin/env bash
# Mitsuba 3.9.1, integrator `volpathmis`: Russian roulette, which is on by default, takes light away. A room whose walls
# shine with 0.2 and reflect 0.8 has the radiance 0.2 / (1 - 0.8) = 1 everywhere, and no medium: `volpathmis` shows 0.98, or
# 0.97 with `rr_depth` 1; without roulette, and by `path` and `volpath`, it is 1. A ball of fog of albedo 1 in a sky of 1 is
# 0.995, or 0.983. With `sample_emitters` false, so that lights are met by scattered rays alone, it is 1.
# Why: a path that survives roulette with probability q has its own density times q (`p_over_f`), but not that of the sample
# of the light that its next ray is weighted against (`p_over_f_nee`). Both belong to a path that has survived: the weight of
# the ray becomes p / (q p + p_light) in place of p / (q (p + p_light)). `update_weights(p_over_f_nee, q, ...)` beside that of
# `p_over_f` would put it right. Lamps without size lose nothing. Seen on 2026-11-29.
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
OFF = 100  # as long as paths may be: what is cut off is 0.8 ** 100
ROOM = {
    "room": {
        "type": "cube", "flip_normals": True, "bsdf": {"type": "diffuse", "reflectance": 0.8},
        "emitter": {"type": "area", "radiance": 0.2},
    },
}
VIEW = Transform().look_at([0.1, 0.2, 0.3], [-1, -0.9, -0.8], [0, 1, 0])
FRONT = Transform().look_at([0, 0, 3], [0, 0, 0], [0, 1, 0])


def ball(sample_emitters):
    fog = {"type": "homogeneous", "sigma_t": 2.0, "albedo": 1.0, "sample_emitters": sample_emitters}
    return {
        "ball": {"type": "sphere", "bsdf": {"type": "null"}, "interior": fog},
        "sky": {"type": "constant", "radiance": 1.0},
    }


def brightness(objects, to_world, integrator, rr_depth):
    """The mean of four pictures, and its standard error."""
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": integrator, "max_depth": 100, "rr_depth": rr_depth},
        "sensor": {
            "type": "perspective", "fov": 40, "to_world": to_world,
            "film": {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": 256},
        },
        **objects,
    })
    means = [float(np.array(mi.render(scene, seed=k))[..., :3].mean()) for k in range(4)]
    return np.mean(means), np.std(means, ddof=1) / 2.0


def show(name, integrator, rr_depth, *objects):
    mean, error = brightness(*objects, integrator, rr_depth)
    roulette = "no roulette" if rr_depth == OFF else f"rr_depth {rr_depth}"
    print(f"{name}, {integrator}, {roulette}: {mean:.4f} +- {error:.4f}")
    return mean


for integrator in ("path", "volpath"):
    assert abs(show("room", integrator, 1, ROOM, VIEW) - 1.0) < 0.01
assert abs(show("room", "volpathmis", 1, ROOM, VIEW) - 0.967) < 0.01
assert abs(show("room", "volpathmis", 5, ROOM, VIEW) - 0.980) < 0.008
assert abs(show("room", "volpathmis", OFF, ROOM, VIEW) - 1.0) < 0.002
for integrator in ("volpath", "volpathmis"):
    fog = show("fog", integrator, 1, ball(True), FRONT)
    assert abs(fog - (0.988 if integrator == "volpathmis" else 1.0)) < 0.006
assert abs(show("fog without samples of lights", "volpathmis", 1, ball(False), FRONT) - 1.0) < 0.006
END
