"""Where a leaf stands, and Mitsuba's shapes under any affine map."""

from typing import Any, NamedTuple

import numpy as np

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.stand_ins import Plugin, Within
from comparisons.mitsuba.translate.errors import UntranslatableError
from reference_rt.core.arrays import FloatArray
from reference_rt.core.transform import Affine
from reference_rt.shapes.shape import Place


class Site(NamedTuple):
    """Where a leaf stands, and of what.

    place: where its own transform is followed by the maps of its solid and its instance;  mirrored:
    whether that of its instance mirrors space, where triangles keep their front although their
    corners then run the other way round;  parts: the BSDF and, where it shines, the emitter;
    coloured: the same for a mesh with colours of its vertices;  textured: whether the look of the
    material depends on the surface's coordinates;  material: its name;  copies: how many of the
    leaf there are;  shared: what the leaves of one scene have in common, by key: a group, the
    triangles of a file;  reach: about the largest coordinate of the scene.
    """

    place: Place
    mirrored: bool
    parts: dict[str, Any]
    coloured: dict[str, Any]
    textured: bool
    material: str | None
    copies: int
    shared: dict[Any, Any]
    reach: float


def to_world(linear: FloatArray, offset: FloatArray) -> Any:
    """p -> linear p + offset; Mitsuba rounds the matrix to float32."""
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([linear, offset])
    return mitsuba().ScalarTransform4f(matrix)


def instance_of(name: str, member: Any, m: Affine, site: Site) -> Plugin:
    """A Mitsuba shape, see `Within.member`, under any affine map: as an instance of a group of its
    own, of which there is one for each `name` and material."""
    if "emitter" in site.parts:
        raise UntranslatableError("emissive material of an instance", "material")
    key = (name, site.material)
    if key not in site.shared:
        if isinstance(member, dict):
            member = {**member, **site.parts}
        site.shared[key] = Within(f"group_{len(site.shared)}", member)
    within: Within = site.shared[key]
    reference = {"type": "ref", "id": within.name}
    value = {"type": "instance", "to_world": to_world(m[:, :3], m[:, 3]), "group": reference}
    return Plugin(value, within=within)


def curved_instance(name: str, m: Affine, site: Site) -> Plugin:
    """Mitsuba's unit shape of type `name`, whose equation is quadratic, under any affine map.

    The group holds a scaled one: within it directions must not be longer than 1, or what llvm
    variants find is far off (of a sphere a tenth as large as the group's: by 1e-2 at distance 10).
    """
    least = np.linalg.svd(m[:, :3], compute_uv=False)[-1]
    scale = 2.0 ** np.floor(np.log2(least))
    member = {"type": name, "to_world": to_world(scale * np.eye(3), np.zeros(3))}
    map_ = np.column_stack([m[:, :3] / scale, m[:, 3]])
    return instance_of(f"{name} {scale}", member, map_, site)._replace(curved=in_float32(least))


def in_float32(radius: float) -> float:
    """`Plugin.curved` of a surface of this radius: scalar variants solve its equation in
    float64."""
    return 0.0 if mitsuba().variant().startswith("scalar") else float(radius)


def is_similarity(linear: FloatArray) -> bool:
    """Whether a map (3, 3) keeps shapes, to within the rounding of its entries."""
    scaled = linear / np.abs(linear).max()
    gram = scaled.T @ scaled
    factor = np.trace(gram) / 3.0
    return bool(np.abs(gram - factor * np.eye(3)).max() <= 64.0 * 2.0**-53 * factor)
