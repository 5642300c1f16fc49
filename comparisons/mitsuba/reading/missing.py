"""Leaves out of a Mitsuba scene what ours lack, in Mitsuba's own description of it: so that both
renderers get the same scene."""

from collections.abc import Callable
from typing import Any, TypeVar

from comparisons.mitsuba.reading.node import MissingError
from comparisons.mitsuba.reading.parse import Parsed, module
from reference_rt.util.errors import SceneError

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
    said: list[str] = []
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
