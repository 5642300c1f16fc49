#!/usr/bin/env bash
# Mitsuba 3.9.1: `prb` and `prb_basic` differentiate `plastic` by its diffuse reflectance as if its mirror reflection were
# diffuse, too. A draw of the mirror's direction is weighed with the change of the value there, which is the diffuse one
# alone: so the derivative has, besides its own, the reflected light over the reflectance. The diffuse light is in proportion
# to the reflectance r, so that the right derivative is (picture(r) - picture(0)) / r, the same for all colours; here
# plastic of (.1, .2, .6) under a white sky reflects .04, and red is too large by .04 / .1, two fifths of it.
# `roughplastic`, whose reflection has a value, is right. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 drjit==1.5.0 numpy==2.4.6 karellen-llvm-core==19.1.7
export DRJIT_LIBLLVM_PATH=$(find "$work/venv" -name 'libLLVM.so.*' | head -1)
cat > plastic.py <<'END'
import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
mi.set_log_level(mi.LogLevel.Error)
COLOUR = np.array([0.1, 0.2, 0.6])


def ratios(plugin, integrator):
    """Of the derivative by a grey step of the reflectance, over the right one; and of what is too
    much over the reflected light divided by the reflectance."""
    film = {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}}
    view = mi.ScalarTransform4f().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0])
    scene = mi.load_dict({
        "type": "scene",
        "sensor": {"type": "perspective", "fov": 20, "to_world": view, "film": film},
        "wall": {
            "type": "rectangle",
            "bsdf": {"type": plugin, "diffuse_reflectance": {"type": "rgb", "value": [0.1, 0.2, 0.6]}},
        },
        "sky": {"type": "constant"},
    })
    values, name = mi.traverse(scene), "wall.bsdf.diffuse_reflectance.value"

    def mean(picture):
        return np.array(picture).mean(axis=(0, 1), dtype=float)

    def picture(*colour):
        values[name] = mi.Color3f(list(map(float, colour)))
        values.update()
        path = mi.load_dict({"type": "path", "max_depth": 2})
        return mean(mi.render(scene, integrator=path, spp=1 << 16, seed=1))

    seen, mirrored = picture(*COLOUR), picture(0.0, 0.0, 0.0)
    right = (seen - mirrored) / COLOUR
    step = mi.Float(0.0)
    dr.enable_grad(step)
    values[name] = mi.Color3f(COLOUR.tolist()) + step
    values.update()
    differentiates = mi.load_dict({"type": integrator, "max_depth": 2})
    found = mi.render(scene, params=values, integrator=differentiates, spp=1 << 14, seed=2)
    dr.forward(step)
    derivative = mean(dr.grad(found))
    return derivative / right, (derivative - right) / (mirrored / COLOUR)


for plugin in ("plastic", "roughplastic"):
    for integrator in ("prb", "prb_basic"):
        ratio, extra = ratios(plugin, integrator)
        told = "too much, over mirrored light / reflectance: %.1f" % extra[0]
        if plugin == "roughplastic":
            told = "within 2 %%: %s" % bool((abs(ratio - 1.0) < 0.02).all())
        print(plugin, integrator, "red %.2f, green %.2f, blue %.2f of the derivative;" % tuple(ratio), told)
END
venv/bin/python plastic.py | sed 's/\x1b\[[0-9;]*m//g' | tee seen
diff seen - <<'END'
plastic prb red 1.40, green 1.20, blue 1.07 of the derivative; too much, over mirrored light / reflectance: 1.0
plastic prb_basic red 1.40, green 1.20, blue 1.07 of the derivative; too much, over mirrored light / reflectance: 1.0
roughplastic prb red 1.00, green 1.00, blue 1.00 of the derivative; within 2 %: True
roughplastic prb_basic red 1.00, green 1.00, blue 1.00 of the derivative; within 2 %: True
END
