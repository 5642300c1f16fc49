"""Shapes that shine: Mitsuba's `area`, and the plugin of ours that takes its place on meshes."""

from typing import Any

from comparisons.geometry import affine
from comparisons.geometry.affine import is_similarity
from comparisons.geometry.flatten import Copy, Leaf, Member
from comparisons.mitsuba.colours import Rgb
from comparisons.mitsuba.node import Node, Reading
from comparisons.textures.reading import colour_or_texture
from reference_rt.integrators import Direct
from reference_rt.shapes import Box, Disk, Mesh, Rectangle, Sphere, Triangle
from reference_rt.shapes.shape import TabulationContext

SAMPLED = (Sphere, Rectangle, Disk, Box, Triangle, Mesh)
"""Emissive shapes of which `reference_rt` samples points, unless a map makes a sphere an ellipsoid.
Other emissive shapes, and parts of groups and of solids, shine where a ray of a BSDF's samples hits
them; Whitted's ray tracing has no such rays but mirrored ones, so that they light nothing."""


def never_samples(
    integrator: Any, copy: Copy, member: Member, leaf: Leaf, place: TabulationContext
) -> bool:
    """Whether a lamp lights nothing, because `reference_rt` samples lights alone and not this one.
    Mitsuba samples the mesh that stands in for it."""
    if not isinstance(integrator, Direct) or integrator.bsdf_samples > 0:
        return False
    shape = leaf.shape
    if copy.instance >= 0 or member.tree is not None or not isinstance(shape, SAMPLED):
        return True
    return isinstance(shape, Sphere) and not is_similarity(affine.map_in(shape, place)[:, :3])


def belongs_to_shape(node: Node) -> bool:
    """Whether an emitter is a lamp's; the second plugin is ours."""
    return node.plugin in ("area", "mesh_area")


def emission(reading: Reading, node: Node) -> Rgb | str:
    """The radiance of a shape's emitter.  Raises SceneError for all but `area`."""
    if not belongs_to_shape(node):
        raise node.unsupported("expected 'area', as the emitter of a shape")
    node.ignore("sampling_weight")  # which lights are sampled does not change the picture
    radiance = colour_or_texture(reading, node, "radiance", 1.0, "emission")
    node.finish()
    return radiance
