"""Materials of a user's file for which Mitsuba 3.9.1 is wrong or approximate, replaced in Mitsuba's
own description of the scene: blends with a perfect mirror, plastics, and Beckmann microfacets.

A replacement keeps the element's own parameters, so that our reading of them is checked.
`comparisons.mitsuba.plugins` proves and corrects each of these errors; `comparisons.mitsuba.notes`
describes it.
"""

from typing import Any

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.notes import note_of
from comparisons.mitsuba.reading.colours import index_of_refraction
from comparisons.mitsuba.reading.node import Node
from comparisons.mitsuba.reading.parse import Parsed
from comparisons.mitsuba.translate.textures import TranslationContext
from reference_rt.materials import Blend, Plastic, RoughConductor, RoughDielectric, RoughPlastic
from reference_rt.rendering.scene import Scene

PLUGINS: dict[type, str] = {
    Blend: "blendbsdf",
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
            _wrap(parsed.state, index, "exact_coat", _coat(node, props))
        elif _distribution(props) == "beckmann":
            _wrap(parsed.state, index, "exact_beckmann", _alphas(props))


def _distribution(props: Any) -> str:
    return str(props.get("distribution", "beckmann"))


def _alphas(props: Any) -> dict[str, Any]:
    return {key: props.get(key, props.get("alpha", 0.1)) for key in ("alpha_u", "alpha_v")}


def _coat(node: Node, props: Any) -> dict[str, Any]:
    inside = index_of_refraction(node, "int_ior", "polypropylene")
    values = {
        "eta": inside / index_of_refraction(node, "ext_ior", "air"),
        "nonlinear": props.get("nonlinear", False),
    }
    if "diffuse_reflectance" in props:
        values["reflectance"] = props["diffuse_reflectance"]
    if node.plugin == "roughplastic":
        alpha = props.get("alpha", props.get("alpha_u", 0.1))
        values |= {"distribution": _distribution(props), "alpha": alpha}
    return values


def _wrap(state: Any, index: int, plugin: str, values: dict[str, Any]) -> None:
    """Put `plugin` in the place of a BSDF, which becomes its parameter `nested`."""
    mi = mitsuba()
    nested = mi.parser.SceneNode()
    nested.type, nested.props = state.nodes[index].type, mi.Properties(state.nodes[index].props)
    is_rough = nested.props.plugin_name() != "plastic"
    if is_rough and _distribution(nested.props) == "beckmann":
        nested.props["sample_visible"] = False  # `plugins.exact_beckmann` says why
    state.nodes.append(nested)
    outer = mi.Properties(plugin)
    outer.set_id(state.nodes[index].props.id())
    outer["nested"] = mi.Properties.ResolvedReference(len(state.nodes) - 1)
    for key, value in values.items():
        outer[key] = value
    state.nodes[index].props = outer


__all__ = ["inexact", "make_exact"]
