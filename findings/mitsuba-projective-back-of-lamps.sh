#!/usr/bin/env bash
# Mitsuba 3.9.1, `direct_projective` and `prb_projective`, with any guiding: the back of an area lamp, which does not shine, counts
# where its edge moves. A disk of radius .5 above a floor of albedo .8 shines down or up; all pixels see the floor under its
# middle. Shining up, the picture is black, and so is its derivative by the radius; Mitsuba's is that of a disk that shines
# down (.51 in the middle: .8 2 r / (1 + r^2)^2). So a ceiling close above a lamp shines. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 drjit==1.5.0 numpy==2.4.6 karellen-llvm-core==19.1.7
export DRJIT_LIBLLVM_PATH=$(find "$work/venv" -name 'libLLVM.so.*' | head -1)
cat > back.py <<'END'
import drjit as dr
import mitsuba as mi

mi.set_variant("llvm_ad_rgb")
mi.set_log_level(mi.LogLevel.Error)
T = mi.ScalarTransform4f


def seen(angle, integrator):
    """The mean of the picture, and of its derivative by the disk's radius, .5."""
    film = {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}}
    view = T().look_at([0, 0, 0.5], [0, 0, 0], [0, 1, 0])
    turned = T().translate([0, 0, 1]) @ T().rotate([1, 0, 0], angle)
    scene = mi.load_dict({
        "type": "scene",
        "sensor": {"type": "perspective", "fov": 20, "to_world": view, "film": film},
        "floor": {
            "type": "rectangle",
            "to_world": T().scale(50),
            "bsdf": {"type": "diffuse", "reflectance": 0.8},
        },
        "lamp": {
            "type": "disk",
            "to_world": turned @ T().scale(0.5),
            "emitter": {"type": "area", "radiance": 1.0},
        },
    })
    values = mi.traverse(scene)
    radius = mi.Float(0.5)
    dr.enable_grad(radius)
    values["lamp.to_world"] = mi.Transform4f(turned) @ mi.Transform4f().scale(radius)
    values.update()
    made = mi.load_dict(integrator)
    picture = mi.render(scene, params=values, integrator=made, spp=16384, seed=1)
    dr.forward(radius)
    return picture.numpy().mean(), dr.grad(picture).numpy().mean()


for integrator in (
    {"type": "direct_projective"},
    {"type": "direct_projective", "guiding": "none"},
    {"type": "prb_projective", "guiding": "none"},
):
    words = " ".join([integrator["type"], integrator.get("guiding", "octree")])
    for side, angle in (("down", 180), ("up", 0)):
        print("%s, shining %s: picture %.1f, derivative %.1f" % (words, side, *seen(angle, integrator)))
END
venv/bin/python back.py | sed 's/\x1b\[[0-9;]*m//g' | tee seen
diff seen - <<'END'
direct_projective octree, shining down: picture 0.2, derivative 0.5
direct_projective octree, shining up: picture 0.0, derivative 0.5
direct_projective none, shining down: picture 0.2, derivative 0.5
direct_projective none, shining up: picture 0.0, derivative 0.5
prb_projective none, shining down: picture 0.2, derivative 0.5
prb_projective none, shining up: picture 0.0, derivative 0.5
END
