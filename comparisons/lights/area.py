"""Shapes that shine: Mitsuba's `area`, and the plugin of ours that takes its place on meshes."""

from comparisons.mitsuba.colours import Rgb
from comparisons.mitsuba.node import Node, Reading
from comparisons.textures.reading import colour_or_texture


def belongs_to_shape(node: Node) -> bool:
    """Whether an emitter is a lamp's; the second plugin is ours."""
    return node.plugin in ("area", "mesh_area")


def emission(reading: Reading, node: Node) -> Rgb | str:
    """The radiance of a shape's emitter.  Raises SceneError for all but `area`."""
    if not belongs_to_shape(node):
        raise node.unsupported("expected 'area', as the emitter of a shape")
    node.children("Medium")  # of particles from it
    node.ignore("sampling_weight")  # which lights are sampled does not change the picture
    radiance = colour_or_texture(reading, node, "radiance", 1.0, "emission")
    node.finish()
    return radiance
