"""Mitsuba -> scene: reads Mitsuba's scenes, .xml files and dictionaries, into our descriptions.

Contract: Mitsuba's own parser (`parse`) gives elements (`node.Node`); a function for each plugin
takes its parameters one by one, with Mitsuba's defaults.  What is not taken, and every plugin
without a function, is a `SceneError` with file, line, column and plugin: nothing is left out
silently.  Shapes get Mitsuba's texture coordinates (`textures.texture` says why).

To read another plugin: a function in the file of our type, and a row in
`tests/comparisons/mitsuba/test_reading_plugins.py`."""

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from comparisons.cameras import read_sensor
from comparisons.integrators import follows_media, read_integrator
from comparisons.lights import read_light
from comparisons.lights.area import belongs_to_shape
from comparisons.materials.reading import material_name
from comparisons.mitsuba.node import MissingError, Node, Reading
from comparisons.mitsuba.parse import Parsed, module, parse_dict, parse_file
from comparisons.shapes.reading import read_shape
from comparisons.translator.moved import mirror
from reference_rt.sampling import AnySampler, Grid, Sobol
from reference_rt.scene.model import WITHOUT_LINES, SceneModel
from reference_rt.util.errors import SceneError, SceneWarning

# ---- what our scenes lack ------------------------------------------------------------------------
# It is left out in Mitsuba's own description of the scene, so that both renderers get the same one.


S = TypeVar("S")

REPLACED = {
    "BSDF": "diffuse",
    "Integrator": "path",
    "Sampler": "independent",
    "ReconstructionFilter": "box",
    "Film": "hdrfilm",
}
"""Kinds of elements that a scene needs, and the plugins that take the place of others, with their
default parameters.  Elements of other kinds are left out."""


def leave_out_missing(parsed: Parsed, read: Callable[[], S]) -> tuple[S, list[str]]:
    """Change `parsed` until `read` finds nothing that our scenes lack: the scene, and what was left
    out, a line each.  Raises the error of what can neither be left out nor replaced, such as a
    camera."""
    said = list(parsed.left_out)
    while True:
        try:
            return read(), said
        except MissingError as error:
            what = error.message.partition("; expected")[0].removesuffix(" here, or unknown")
            text = f"{what}, and {_leave_out(parsed.state, error)} on both sides"
            said.append(str(SceneError(text, file=error.file, line=error.line)))


def _leave_out(state: Any, error: MissingError) -> str:
    """Change the element or the parameter of an error; what was done, in words."""
    props, kind = state.nodes[error.index].props, state.nodes[error.index].type.name
    if error.key:
        del props[error.key]
        return "left out"
    if kind == "Sensor" or props.plugin_name() == REPLACED.get(kind):
        raise error
    if kind in REPLACED:
        new = module().Properties(REPLACED[kind])
        new.set_id(props.id())
        if kind == "Film":
            for key in ("width", "height"):
                if key in props:
                    new[key] = props[key]
        state.nodes[error.index].props = new
        return f"replaced by '{REPLACED[kind]}'"
    for node in state.nodes:
        for key in list(node.props.keys()):
            value = node.props[key]
            if type(value).__name__ == "ResolvedReference" and value.index() == error.index:
                del node.props[key]
    return "left out"


# ---- whole scenes --------------------------------------------------------------------------------


M = TypeVar("M", bound=SceneModel)


def read_file(
    path: Path,
    cls: type[M],
    defaults: Mapping[str, str] | None = None,
    allow_missing: bool = False,
) -> M:
    """The scene in an .xml file, an object of `cls`;  defaults: values for its <default> elements;
    allow_missing: whether to leave out what our scenes lack, with a warning for each.

    Raises SceneError, ReferenceUnavailableError without Mitsuba; warns of what is read otherwise.
    """
    parsed = parse_file(path, defaults or {}, allow_missing)
    if allow_missing:
        scene, left_out = read_supported(parsed, cls)
        for text in left_out:
            warnings.warn(SceneWarning(text), stacklevel=3)
    else:
        scene = _scene(parsed, cls)
    scene._source, scene._defaults = (str(path), WITHOUT_LINES), dict(defaults or {})
    scene._allows_missing = allow_missing
    return scene


def read_dict(scene: Mapping[str, Any], cls: type[M], folder: Path | None = None) -> M:
    """The scene in a dictionary for `mitsuba.load_dict`;  folder: of its files.  Raises as
    `read_file` does."""
    read = _scene(parse_dict(scene, Path() if folder is None else folder), cls)
    read._source = None
    return read


def read_supported(parsed: Parsed, cls: type[M]) -> tuple[M, list[str]]:
    """The scene without what ours lack, which is left out of `parsed`, too; and what it was."""
    return leave_out_missing(parsed, lambda: _scene(parsed, cls))


def _scene(parsed: Parsed, cls: type[M]) -> M:
    reading = Reading(parsed, material_name)
    for index, text in parsed.notes:
        reading.note(Node(parsed, index), text)
    root = Node(parsed, 0)
    if root.kind != "Scene":
        raise root.error("is no scene; expected an element <scene>")
    # They concern how rays are traced, not what they find.
    root.ignore("embree_use_robust_intersections", "allow_thread_reordering")
    root.ignore("compact_acceleration_structures")
    nodes = root.children(*_KINDS)
    root.children("BSDF", "Texture", "Film", "Sampler", "ReconstructionFilter")  # used by others
    root.children("Medium", "Volume", "PhaseFunction")
    sensors = [node for node in nodes if node.kind == "Sensor"]
    if len(sensors) > 1:
        reading.note(sensors[0], f"is the first of {len(sensors)} sensors; the others are left out")
    integrators = [node for node in nodes if node.kind == "Integrator"]
    reading.follows_media = any(map(follows_media, integrators))
    for node in nodes:
        if node.kind == "Shape":
            read_shape(reading, node)
        elif node.kind == "Emitter" and not belongs_to_shape(node):
            read_light(reading, node)
    if len(integrators) > 1:
        raise integrators[1].error("is a second integrator; expected one")
    integrator, layers = read_integrator(reading, integrators[0] if integrators else None)
    sampler: AnySampler | None
    camera, film, sampler = read_sensor(reading, sensors[0] if sensors else None)
    if reading.mirrored_for is not None:
        mirror(reading, reading.mirrored_for)
    root.finish()
    if not sensors and parsed.file != "<dict>":
        raise root.error("has no sensor; expected one")
    if integrator.deterministic != isinstance(sampler, Grid):
        # Points on a grid are for what is not random, and the others for what is.
        sampler = None if integrator.deterministic else Sobol(spp=sampler.spp)
    with root.checking():
        scene = cls(
            camera=camera,
            film=film.model_copy(update={"layers": layers}),
            sampler=sampler,
            integrator=integrator,
            textures=reading.textures,
            materials=reading.materials,
            media=reading.media,
            groups=reading.groups,
            shapes=tuple(reading.shapes),
            lights=tuple(reading.lights),
        )
    scene._folder, scene._source = parsed.folder, (parsed.file, WITHOUT_LINES)
    for note in reading.notes:
        warnings.warn(SceneWarning(note), stacklevel=4)
    return scene


_KINDS = ("Sensor", "Shape", "Emitter", "Integrator")
