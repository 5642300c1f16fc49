#!/usr/bin/env bash
# Mitsuba 3.9.1, attributes of a mesh's vertices (the texture `mesh_attribute`) in an instance: they are interpolated at
# the point in the world, not at that in the group, and so have values that no vertex has. uv are right. The same mesh
# under the same transform without a group has the right values. Seen on 2026-11-28.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 numpy==2.4.6
cat > value.py <<'END'
import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
place = mi.ScalarTransform4f().translate([3, 2, 1]) @ mi.ScalarTransform4f().scale(2)
corners = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])


def mesh(corners):
    """A triangle whose attribute is its uv."""
    found = mi.Mesh("mesh", 3, 1, has_vertex_texcoords=True)
    values = mi.traverse(found)
    values["vertex_positions"] = corners.astype(np.float32).ravel()
    values["faces"] = np.uint32([0, 1, 2])
    values["vertex_texcoords"] = np.float32([0, 0, 1, 0, 0, 1])
    values.update()
    found.add_attribute("vertex_color", 3, np.float32([0, 0, 0, 1, 0, 0, 0, 1, 0]))
    return found


group = {"type": "shapegroup", "id": "group", "mesh": mesh(corners)}
instance = {"type": "instance", "to_world": place, "shapegroup": {"type": "ref", "id": "group"}}
for name, parts in (("instance", {"group": group, "instance": instance}), ("mesh", {"mesh": mesh(2 * corners + [3, 2, 1])})):
    ray = mi.Ray3f([3.4, 2.6, 9], [0, 0, -1])
    hit = mi.load_dict({"type": "scene", **parts}).ray_intersect(ray)
    u, v, _ = hit.shape.eval_attribute_3("vertex_color", hit)
    print(f"{name}: uv {hit.uv[0]:.2f} {hit.uv[1]:.2f} attribute {u:.2f} {v:.2f}")
END
venv/bin/python value.py | tee seen
grep -q "^mesh: uv 0.20 0.30 attribute 0.20 0.30$" seen
grep -q "^instance: uv 0.20 0.30 attribute " seen
! grep -q "^instance: uv 0.20 0.30 attribute 0.20 0.30$" seen
