#!/usr/bin/env bash
# Mitsuba 3.9.1, forward mode, where a shape or a lamp has two numbers that differentiate. By a sphere's size (the scale in
# its `to_world`) the derivative is 0 in each pixel. By the `beam_width` of a spot it is 0, too, and by its
# `cutoff_angle` it is the sum of the derivatives by both. Reverse mode, with the same integrator and random numbers,
# and differences of Mitsuba's own pictures agree with each other. By the sphere's centre both modes are right. No edge
# moves here: the sphere fills the view, and the spot's light falls off continuously. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 drjit==1.5.0 numpy==2.4.6 karellen-llvm-core==19.1.7
export DRJIT_LIBLLVM_PATH=$(find "$work/venv" -name 'libLLVM.so.*' | head -1)
cat > modes.py <<'END'
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

spot = mi.load_dict({
    "type": "scene",
    "integrator": {"type": "prb", "max_depth": 2},
    "sensor": {
        "type": "perspective",
        "fov": 40,
        "to_world": T().look_at([0, -4, 4], [0, 0, 0], [0, 0, 1]),
        "film": {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}},
    },
    "floor": {"type": "rectangle", "to_world": T().scale(5), "bsdf": {"type": "diffuse"}},
    "lamp": {
        "type": "spot",
        "to_world": T().look_at([0, 0, 3], [0, 0, 0], [0, 1, 0]),
        "intensity": 10.0,
        "cutoff_angle": 30,
        "beam_width": 20,
    },
})
angles = mi.traverse(spot)
found = {}
for name, start in (("cutoff_angle", 30.0), ("beam_width", 20.0)):
    for mode in ("forward", "reverse"):
        angle = mi.Float(start)
        dr.enable_grad(angle)
        angles[f"lamp.{name}"] = angle
        angles.update()
        image = mi.render(spot, params=angles, spp=256, seed=1)
        if mode == "forward":
            dr.forward(angle)
            found[name, mode] = float(dr.grad(image).numpy().sum())
        else:
            dr.backward(dr.sum(image, axis=None))
            found[name, mode] = float(dr.grad(angle)[0])
    sums = []
    for x in (0.1, -0.1):
        angles[f"lamp.{name}"] = mi.Float(start + x)
        angles.update()
        sums.append(float(mi.render(spot, spp=256, seed=1).numpy().sum()))
    angles[f"lamp.{name}"] = mi.Float(start)
    angles.update()
    print(name, "reverse / differences %.1f" % (found[name, "reverse"] / (sums[0] - sums[1]) * 0.2))
both = found["cutoff_angle", "reverse"] + found["beam_width", "reverse"]
print("cutoff_angle forward / both reverse %.1f" % (found["cutoff_angle", "forward"] / both))
print("beam_width forward %.0f" % found["beam_width", "forward"])
END
venv/bin/python modes.py | sed 's/\x1b\[[0-9;]*m//g' | tee seen
diff seen - <<'END'
radius: forward 0, reverse / differences 1.0
centre: forward / differences 1.0, reverse / differences 1.0
cutoff_angle reverse / differences 1.0
beam_width reverse / differences 1.0
cutoff_angle forward / both reverse 1.0
beam_width forward 0
END
