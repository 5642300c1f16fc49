"""The user's own file as the reference of a comparison: loaded by Mitsuba, and untouched but for
the film's size and filter, the samples, what makes Mitsuba's own picture wrong
(`changes_to`), and what `Scene.load` was asked to leave out.  So our reading of the file is
checked, too."""

import warnings
from collections.abc import Callable
from typing import Any

from comparisons.integrators import translate_integrator
from comparisons.materials import type_of
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.colours import index_of_refraction
from comparisons.mitsuba.context import TranslationContext, UntranslatableError
from comparisons.mitsuba.node import Node
from comparisons.mitsuba.parse import Parsed, file_of, parse_file
from comparisons.mitsuba.plugins.exact_coat import COLOURS, SUBSTITUTE
from comparisons.renderers import ReferenceSampler
from comparisons.textures.texture import matrix_of
from comparisons.translator.mistakes import (
    BLACK,
    ROULETTE,
    by_paths,
    counts_lights_often,
    drops_light,
    in_place_of,
    notes_of_integrator,
)
from comparisons.translator.notes import note_of
from comparisons.translator.reading import read_supported
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceUnavailableError

# ---- materials for which Mitsuba is wrong or approximate -----------------------------------------
# Blends with a perfect mirror, plastics, Beckmann microfacets and bump maps are replaced in
# Mitsuba's own description of the scene. A replacement keeps the element's own parameters, so that
# our reading of them is checked. `comparisons.mitsuba.plugins` proves and corrects each of these
# errors; `comparisons.translator.notes` describes it.


def inexact(scene: Scene) -> list[tuple[str, str]]:
    """Mitsuba's plugin, and the note on its error, of each material that Mitsuba has wrong."""
    context = TranslationContext.of(scene)
    tables = [(type_of(m).table, m) for m in scene.materials.values()]
    replaced = [(table.plugin, m) for table, m in tables if table and table.plugin in EXACT]
    notes = [(plugin, note_of(m, context)) for plugin, m in replaced]
    return [(plugin, note) for plugin, note in notes if note]


def make_exact(parsed: Parsed, scene: Scene) -> None:
    """Replace these materials in the description of the file that `scene` was read from."""
    plugins = {plugin for plugin, _ in inexact(scene)}
    for index in range(len(parsed.state.nodes) if plugins else 0):
        node = Node(parsed, index)
        if node.kind == "BSDF" and node.plugin in plugins:
            EXACT[node.plugin](parsed, index, node)


def sample_visible(parsed: Parsed) -> list[str]:
    """Have all rough dielectrics sample visible normals: Mitsuba's other way is wrong (see
    `plugins.exact_coat`).  Returns a note if any did not."""
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


MESH_FILES = ("obj", "ply", "serialized")


def exact_lamps(parsed: Parsed) -> list[str]:
    """Replace Mitsuba's emitter of meshes where it is not exact (see `plugins.mesh_area`): beside
    vertex normals, which meshes without `face_normals` have, and with a texture.  Returns a note if
    any was."""
    replaced = False
    nodes = parsed.state.nodes
    for index in range(len(nodes)):
        node = Node(parsed, index)
        if node.kind != "Shape" or node.plugin not in MESH_FILES:
            continue
        for _, emitter in node.named_children("Emitter"):
            props = nodes[emitter.index].props
            of_texture = any(True for _ in emitter.named_children("Texture"))
            if of_texture or not nodes[index].props.get("face_normals", False):
                props.set_plugin_name("mesh_area")
                props["turned"] = True
                replaced = True
    if not replaced:
        return []
    return [
        "lamps that are meshes with vertex normals or a texture have an emitter of ours: Mitsuba's "
        "weighs samples by the vertex normals, which also decide which side shines, and looks for "
        "the place of a texture's bright texels, of which a mesh may have several or none"
    ]


def _blend(parsed: Parsed, index: int, node: Node) -> None:
    parsed.state.nodes[index].props.set_plugin_name("mixture_blend")


def _coated(parsed: Parsed, index: int, node: Node) -> None:
    state, props = parsed.state, parsed.state.nodes[index].props
    attributes = _attributes(parsed, props)
    _wrap(state, index, "exact_coat", _coat(node, props, attributes))
    for name in attributes:
        state.nodes[-1].props[name] = SUBSTITUTE


def _beckmann(parsed: Parsed, index: int, node: Node) -> None:
    props = parsed.state.nodes[index].props
    if _distribution(props) == "beckmann":
        _wrap(parsed.state, index, "exact_beckmann", _alphas(props))


def _bump(parsed: Parsed, index: int, node: Node) -> None:
    """Replace a bump map.  Its image is looked up in its own coordinates: a copy of it without
    `to_uv`, which the plugin applies itself, and to the slopes rightly."""
    mi, state = mitsuba(), parsed.state
    props = state.nodes[index].props
    ((base, _),) = node.named_children("BSDF")
    ((height, image),) = node.named_children("Texture")
    m = matrix_of(image)
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


EXACT: dict[str, Callable[[Parsed, int, Node], None]] = {
    "blendbsdf": _blend,
    "bumpmap": _bump,
    "plastic": _coated,
    "roughplastic": _coated,
    "roughconductor": _beckmann,
    "roughdielectric": _beckmann,
}
"""What replaces an element, by Mitsuba's plugin."""


# ---- the scene of a user's file ------------------------------------------------------------------


def own_scene(scene: Scene, sampler: ReferenceSampler = "independent") -> Any:
    """Mitsuba's scene of the file that `scene` was read from, for pictures of the size that `scene`
    has, with a box filter and this sampler.

    Raises SceneError, UntranslatableError for a size that the film's window cannot have,
    ReferenceUnavailableError for a file that Mitsuba does not load.
    """
    mi = mitsuba()
    parsed, _ = _parsed(scene)
    state = parsed.state
    sensor = _first(state, mi.ObjectType.Sensor)
    if sensor is None:
        raise UntranslatableError("of a file that has none", "camera")
    film = _child(mi, state, sensor, mi.ObjectType.Film, "hdrfilm")
    _resize(state.nodes[film].props, scene)
    values = {"pixel_format": "rgb", "component_format": "float32", "file_format": "openexr"}
    for name, value in values.items():
        state.nodes[film].props[name] = value
    box = _child(mi, state, film, mi.ObjectType.ReconstructionFilter, "box")
    state.nodes[box].props = mi.Properties("box")
    drawn = _child(mi, state, sensor, mi.ObjectType.Sampler, sampler)
    state.nodes[drawn].props = mi.Properties(sampler)
    _child(mi, state, 0, mi.ObjectType.Integrator, "path")
    _without_moments(mi, state)
    if counts_lights_often(scene):
        _with_one_sample(mi, state)
    if (ours := in_place_of(scene) or by_paths(scene)) is not None:
        index = _first(state, mi.ObjectType.Integrator)
        assert index is not None
        state.nodes[index].props = _properties(mi, ours)
    if scene.has_media:
        _without_roulette(mi, state, scene)
    if drops_light(scene):
        _with_black_environment(mi, state)
    sample_visible(parsed)
    exact_lamps(parsed)
    make_exact(parsed, scene)
    config = mi.parser.ParserConfig(mi.variant())
    config.merge_equivalent = config.merge_meshes = False
    old = mi.file_resolver()
    resolver = mi.FileResolver(old)
    for folder in (parsed.folder, *reversed(parsed.paths)):
        resolver.prepend(str(folder))
    mi.set_file_resolver(resolver)
    try:
        mi_scene = mi.parser.instantiate(config, state)
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise ReferenceUnavailableError(f"Mitsuba does not load {parsed.file}: {reason}") from None
    finally:
        mi.set_file_resolver(old)
    return mi_scene


def changes_to(scene: Scene) -> list[str]:
    """What `own_scene` changes in the file beyond the film and the samples, for the report."""
    parsed, changes = _parsed(scene)
    changes += notes_of_integrator(scene)
    plugins = {node.props.plugin_name() for node in parsed.state.nodes}
    if "volpathmis" in plugins and scene.has_media and in_place_of(scene) is None:
        changes.append(ROULETTE)
    changes += dict.fromkeys(note for _, note in inexact(scene))
    changes += sample_visible(parsed)
    changes += exact_lamps(parsed)
    changes += dict.fromkeys(text for _, text in parsed.notes)
    return changes


def _parsed(scene: Scene) -> tuple[Parsed, list[str]]:
    """The file of a scene, without what `Scene.load` was asked to leave out; and what it was."""
    path = file_of(scene)
    assert path is not None
    parsed = parse_file(path, scene.defaults, scene.allows_missing)
    if not scene.allows_missing:
        return parsed, []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they were issued when the scene was loaded
        return parsed, read_supported(parsed, Scene)[1]


def _properties(mi: Any, described: dict[str, Any]) -> Any:
    """A plugin's dictionary as Mitsuba's properties."""
    properties = mi.Properties(described["type"])
    for name, value in described.items():
        if name != "type":
            properties[name] = value
    return properties


def _first(state: Any, kind: Any) -> int | None:
    """The first of the root's nodes of this kind."""
    root = state.nodes[0].props
    for index in _references(root):
        if state.nodes[index].type == kind:
            return index
    return None


def _references(props: Any) -> list[int]:
    values = (props[key] for key in props.keys())  # noqa: SIM118
    return [value.index() for value in values if type(value).__name__ == "ResolvedReference"]


def _child(mi: Any, state: Any, parent: int, kind: Any, plugin: str) -> int:
    """The child of this kind, which is added if there is none."""
    for index in _references(state.nodes[parent].props):
        if state.nodes[index].type == kind:
            return index
    node = mi.parser.SceneNode()
    node.type, node.props = kind, mi.Properties(plugin)
    state.nodes.append(node)
    index = len(state.nodes) - 1
    state.nodes[parent].props[f"added_{plugin}"] = mi.Properties.ResolvedReference(index)
    return index


def _with_black_environment(mi: Any, state: Any) -> None:
    node = mi.parser.SceneNode()
    node.type, node.props = mi.ObjectType.Emitter, mi.Properties(BLACK["type"])
    node.props["radiance"] = 0.0
    node.props["sampling_weight"] = BLACK["sampling_weight"]
    state.nodes.append(node)
    state.nodes[0].props["added_black"] = mi.Properties.ResolvedReference(len(state.nodes) - 1)


def _resize(film: Any, scene: Scene) -> None:
    """Give the film the size of ours, which is that of its window."""
    width, height = (int(film.get(k, d)) for k, d in (("width", 768), ("height", 576)))
    given = {
        "width": width,
        "height": height,
        "crop_width": int(film.get("crop_width", width)),
        "crop_height": int(film.get("crop_height", height)),
        "crop_offset_x": int(film.get("crop_offset_x", 0)),
        "crop_offset_y": int(film.get("crop_offset_y", 0)),
    }
    wanted = (scene.film.width, scene.film.height)
    old = (given["crop_width"], given["crop_height"])
    for k, (name, value) in enumerate(given.items()):
        new, rest = divmod(value * wanted[k % 2], old[k % 2])
        if rest:
            raise UntranslatableError(
                f"Film, whose window of {old[0]} x {old[1]} pixels becomes {wanted[0]} x "
                f"{wanted[1]}, so that its '{name}' is no whole number,",
                "film",
            )
        film[name] = new
    is_view = getattr(scene.camera, "view", None) is not None
    if is_view and wanted[0] * old[1] != wanted[1] * old[0]:
        raise UntranslatableError("view, which is shifted, in a picture of another shape", "camera")


def _without_moments(mi: Any, state: Any) -> None:
    """The integrator inside in place of one that only adds channels."""
    root = state.nodes[0].props
    for key in list(root.keys()):
        value = root[key]
        if type(value).__name__ != "ResolvedReference":
            continue
        node = state.nodes[value.index()]
        if node.type == mi.ObjectType.Integrator and node.props.plugin_name() in ("moment", "aov"):
            inside = [
                k
                for k in _references(node.props)
                if state.nodes[k].type == mi.ObjectType.Integrator
            ]
            if inside:
                root[key] = mi.Properties.ResolvedReference(inside[0])


def _without_roulette(mi: Any, state: Any, scene: Scene) -> None:
    """`volpathmis` without Russian roulette, or `volpath`, where the file has it."""
    wanted = translate_integrator(scene.integrator, scene.has_media)
    for node in state.nodes:
        is_it = node.type == mi.ObjectType.Integrator and node.props.plugin_name() == "volpathmis"
        if is_it and wanted is not None:
            node.props = _properties(mi, wanted)


def _with_one_sample(mi: Any, state: Any) -> None:
    """One sample of lights in direct illumination: its mean is right for no other number."""
    for node in state.nodes:
        if node.type == mi.ObjectType.Integrator and node.props.plugin_name() == "direct":
            # The one name stands for both numbers of samples, and excludes the other.
            name = "shading_samples" if "shading_samples" in node.props else "emitter_samples"
            node.props[name] = 1
