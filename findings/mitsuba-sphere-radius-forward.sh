#!/usr/bin/env bash
# Mitsuba 3.9.1: by a sphere's size (the scale in its `to_world`), forward mode says that the picture does not change:
# the derivative is 0 in each pixel. Reverse mode, with the same integrator and random numbers, and differences of
# Mitsuba's own pictures agree on another number. By the sphere's centre both modes are right, and so they are by the
# size of a cylinder or a disk. Here a sphere that fills the whole view is lit by a point light: no edge moves. Seen on
# 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 drjit==1.5.0 numpy==2.4.6 karellen-llvm-core==19.1.7
export DRJIT_LIBLLVM_PATH=$(find "$work/venv" -name 'libLLVM.so.*' | head -1)
cat > sphere.py <<'END'
import drjit as dr
import mitsuba as mi

mi.set_variant("llvm_ad_rgb")
mi.set_log_level(mi.LogLevel.Error)
T = mi.ScalarTransform4f
scene = mi.load_dict({
    "type": "scene",
    "integrator": {"type": "prb", "max_depth": 2},
    "sensor": {
        "type": "perspective",
        "fov": 20,
        "to_world": T().look_at([0, -2, 0], [0, 0, 0], [0, 0, 1]),
        "film": {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}},
    },
    "ball": {"type": "sphere", "bsdf": {"type": "diffuse"}},
    "lamp": {"type": "point", "position": [2, -3, 1], "intensity": 10.0},
})
values = mi.traverse(scene)


def picture(radius, x, seed=1):
    values["ball.to_world"] = mi.Transform4f().translate([x, 0, 0]) @ mi.Transform4f().scale(radius)
    values.update()
    return mi.render(scene, params=values, spp=64, seed=seed)


def derivatives(of_radius):
    """The sum over pixels: forward, reverse, and by differences."""
    found = []
    for forward in (True, False):
        number = mi.Float(1.0 if of_radius else 0.0)
        dr.enable_grad(number)
        image = picture(number, 0.0) if of_radius else picture(mi.Float(1.0), number)
        if forward:
            dr.forward(number)
            found.append(float(dr.grad(image).numpy().sum()))
        else:
            dr.backward(dr.sum(image, axis=None))
            found.append(float(dr.grad(number)[0]))
    h = 0.01
    pair = [picture(mi.Float(1 + x), 0.0) if of_radius else picture(mi.Float(1), mi.Float(x)) for x in (h, -h)]
    return [*found, float((pair[0] - pair[1]).numpy().sum() / (2 * h))]


forward, reverse, differences = derivatives(True)
print("radius: forward %.0f, reverse / differences %.1f" % (forward, reverse / differences))
forward, reverse, differences = derivatives(False)
print("centre: forward / differences %.1f, reverse / differences %.1f" % (forward / differences, reverse / differences))
END
venv/bin/python sphere.py | sed 's/\x1b\[[0-9;]*m//g' | tee seen
diff seen - <<'END'
radius: forward 0, reverse / differences 1.0
centre: forward / differences 1.0, reverse / differences 1.0
END
