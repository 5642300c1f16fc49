#!/usr/bin/env bash
# Mitsuba 3.9.1, `direct_projective` and `prb_projective` with `guiding: grid`: the derivative by an edge that moves is
# too small by a factor that grows with the number of pixels, without a warning. Here a black disk of radius r hides a
# part of a white sky from a floor; with `guiding: none` the mean derivative by r does not depend on the picture's
# size, with `grid` it is four times as large for four times the pixels, and at 16 x 16 a 270th of the right one. Both
# modes of differentiation agree with each other. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 drjit==1.5.0 numpy==2.4.6 karellen-llvm-core==19.1.7
export DRJIT_LIBLLVM_PATH=$(find "$work/venv" -name 'libLLVM.so.*' | head -1)
cat > grid.py <<'END'
import drjit as dr
import mitsuba as mi

mi.set_variant("llvm_ad_rgb")
mi.set_log_level(mi.LogLevel.Error)
T = mi.ScalarTransform4f


def mean(side, guiding):
    """Of the derivative by the disk's radius, .5."""
    film = {"type": "hdrfilm", "width": side, "height": side, "rfilter": {"type": "box"}}
    view = T().look_at([0, 0, 0.9], [0, 0, 0], [0, 1, 0])
    scene = mi.load_dict({
        "type": "scene",
        "sensor": {"type": "perspective", "fov": 60, "to_world": view, "film": film},
        "floor": {"type": "rectangle", "to_world": T().scale(50), "bsdf": {"type": "diffuse"}},
        "disk": {
            "type": "disk",
            "to_world": T().translate([0, 0, 1]) @ T().scale(0.5),
            "bsdf": {"type": "diffuse", "reflectance": 0.0},
        },
        "sky": {"type": "constant"},
    })
    values = mi.traverse(scene)
    radius = mi.Float(0.5)
    dr.enable_grad(radius)
    values["disk.to_world"] = mi.Transform4f().translate([0, 0, 1]) @ mi.Transform4f().scale(radius)
    values.update()
    integrator = mi.load_dict({"type": "direct_projective", "guiding": guiding})
    picture = mi.render(scene, params=values, integrator=integrator, spp=1024, seed=1)
    dr.forward(radius)
    return dr.grad(picture).numpy().mean()


print("ratio of 16 x 16 and 8 x 8, none: %.1f" % (mean(16, "none") / mean(8, "none")))
print("ratio of 16 x 16 and 8 x 8, grid: %.0f" % (mean(16, "grid") / mean(8, "grid")))
print("grid over none at 16 x 16 is below 1 %%: %s" % (0 < mean(16, "grid") / mean(16, "none") < 0.01))
END
venv/bin/python grid.py | sed 's/\x1b\[[0-9;]*m//g' | tee seen
diff seen - <<'END'
ratio of 16 x 16 and 8 x 8, none: 1.0
ratio of 16 x 16 and 8 x 8, grid: 4
grid over none at 16 x 16 is below 1 %: True
END
