"""Materials of a user's file for which Mitsuba 3.9.1 is wrong or approximate, replaced in Mitsuba's
own description of the scene: blends with a perfect mirror, plastics, Beckmann microfacets, and bump
maps.

A replacement keeps the element's own parameters, so that our reading of them is checked.
`comparisons.mitsuba.plugins` proves and corrects each of these errors; `comparisons.mitsuba.notes`
describes it.
"""

from typing import Any

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.notes import note_of
from comparisons.mitsuba.plugins.exact_coat import COLOURS, SUBSTITUTE
from comparisons.mitsuba.reading.colours import index_of_refraction
from comparisons.mitsuba.reading.node import Node
from comparisons.mitsuba.reading.parse import Parsed
from comparisons.mitsuba.reading.textures import to_uv
from comparisons.mitsuba.translate.textures import TranslationContext
from reference_rt.materials import (
    Blend,
    Bump,
    Plastic,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
)
from reference_rt.rendering.scene import Scene

PLUGINS: dict[type, str] = {
    Blend: "blendbsdf",
    Bump: "bumpmap",
    Plastic: "plastic",
    RoughPlastic: "roughplastic",
    RoughConductor: "roughconductor",
    RoughDielectric: "roughdielectric",
}
"""Mitsuba's plugins by our material."""


def inexact(scene: Scene) -> list[tuple[str, str]]:
    """Mitsuba's plugin, and the note on its error, of each material that Mitsuba has wrong."""
    context = TranslationContext.of(scene)
    materials = [m for m in scene.materials.values() if type(m) in PLUGINS]
    notes = [(PLUGINS[type(m)], note_of(m, context)) for m in materials]
    return [(plugin, note) for plugin, note in notes if note]


def make_exact(parsed: Parsed, scene: Scene) -> None:
    """Replace these materials in the description of the file that `scene` was read from."""
    plugins = {plugin for plugin, _ in inexact(scene)}
    for index in range(len(parsed.state.nodes) if plugins else 0):
        node = Node(parsed, index)
        if node.kind != "BSDF" or node.plugin not in plugins:
            continue
        props = parsed.state.nodes[index].props
        if node.plugin == "blendbsdf":
            props.set_plugin_name("mixture_blend")
        elif node.plugin in ("plastic", "roughplastic"):
            attributes = _attributes(parsed, props)
            _wrap(parsed.state, index, "exact_coat", _coat(node, props, attributes))
            for name in attributes:
                parsed.state.nodes[-1].props[name] = SUBSTITUTE
        elif node.plugin == "bumpmap":
            _bump(parsed.state, index, node)
        elif _distribution(props) == "beckmann":
            _wrap(parsed.state, index, "exact_beckmann", _alphas(props))


def sample_visible(parsed: Parsed) -> list[str]:
    """Have all rough dielectrics sample visible normals: Mitsuba's other way is wrong (see
    `plugins.exact_beckmann`).  Returns a note if any did not."""
    every = [node.props for node in parsed.state.nodes]
    glasses = [props for props in every if props.plugin_name() == "roughdielectric"]
    wrong = [props for props in glasses if not props.get("sample_visible", True)]
    for props in wrong:
        props["sample_visible"] = True
    if not wrong:
        return []
    return [
        "rough dielectrics sample visible normals: without, Mitsuba draws normals from a rougher "
        "distribution, which its weights leave out"
    ]


def _bump(state: Any, index: int, node: Node) -> None:
    """Replace a bump map.  Its image is looked up in its own coordinates: a copy of it without
    `to_uv`, which the plugin applies itself, and to the slopes rightly."""
    mi, props = mitsuba(), state.nodes[index].props
    ((base, _),) = node.named_children("BSDF")
    ((height, image),) = node.named_children("Texture")
    m = to_uv(image)
    copied = mi.parser.SceneNode()
    old = state.nodes[props[height].index()]
    copied.type, copied.props = old.type, mi.Properties(old.props)
    if "to_uv" in copied.props:
        del copied.props["to_uv"]
    state.nodes.append(copied)
    exact = mi.Properties("exact_bump")
    exact.set_id(props.id())
    exact["base"] = props[base]
    exact["height"] = mi.Properties.ResolvedReference(len(state.nodes) - 1)
    exact["scale"] = props.get("scale", 1.0)
    for key in ("flip_invalid_normals", "use_shadowing_function"):
        exact[key] = props.get(key, True)
    for row, letter in enumerate("uv"):
        for column, other in enumerate("uv1"):
            exact[f"{letter}_{other}"] = float(m[row, column])
    state.nodes[index].props = exact


def _distribution(props: Any) -> str:
    return str(props.get("distribution", "beckmann"))


def _alphas(props: Any) -> dict[str, Any]:
    return {key: props.get(key, props.get("alpha", 0.1)) for key in ("alpha_u", "alpha_v")}


def _attributes(parsed: Parsed, props: Any) -> list[str]:
    """The colours of a plastic that are attributes of meshes: of these Mitsuba has no mean, without
    which it refuses the file (see `plugins.exact_coat`)."""
    references = {name: props[name] for name in COLOURS if name in props}
    return [
        name
        for name, value in references.items()
        if type(value).__name__ == "ResolvedReference"
        and Node(parsed, value.index()).plugin == "mesh_attribute"
    ]


def _coat(node: Node, props: Any, attributes: list[str]) -> dict[str, Any]:
    inside = index_of_refraction(node, "int_ior", "polypropylene")
    values = {
        "eta": inside / index_of_refraction(node, "ext_ior", "air"),
        "nonlinear": props.get("nonlinear", False),
    }
    if "diffuse_reflectance" in props:
        values["reflectance"] = props["diffuse_reflectance"]
    if "specular_reflectance" in attributes:
        values["specular"] = props["specular_reflectance"]
    if node.plugin == "roughplastic":
        alpha = props.get("alpha", props.get("alpha_u", 0.1))
        values |= {"distribution": _distribution(props), "alpha": alpha}
    return values


def _wrap(state: Any, index: int, plugin: str, values: dict[str, Any]) -> None:
    """Put `plugin` in the place of a BSDF, which becomes its parameter `nested`."""
    mi = mitsuba()
    nested = mi.parser.SceneNode()
    nested.type, nested.props = state.nodes[index].type, mi.Properties(state.nodes[index].props)
    if plugin == "exact_beckmann":
        nested.props["sample_visible"] = True  # the plugin says why
    elif nested.props.plugin_name() != "plastic" and _distribution(nested.props) == "beckmann":
        nested.props["sample_visible"] = False  # the density of visible normals has Mitsuba's G1
    state.nodes.append(nested)
    outer = mi.Properties(plugin)
    outer.set_id(state.nodes[index].props.id())
    outer["nested"] = mi.Properties.ResolvedReference(len(state.nodes) - 1)
    for key, value in values.items():
        outer[key] = value
    state.nodes[index].props = outer


__all__ = ["inexact", "make_exact", "sample_visible"]
