"""What Mitsuba 3 refuses or renders in another way though its meaning is known: spellings of
Mitsuba 0.4 to 0.6, integrators for derivatives, sensors that group others.  It is changed in
Mitsuba's own description of the scene, so that both renderers get the same one."""

import re
from typing import Any

Note = tuple[int, str]
"""The index of an element, and what was changed."""

OLD_ELEMENT = re.compile(rb"(</?)lookAt\b")
"""Mitsuba 0.6 and Mitsuba 3 spell it differently.  Everything else in camel case is upgraded by
Mitsuba's own parser."""

PRIMAL = {
    "prb": "path",
    "prb_basic": "path",
    "prb_projective": "path",
    "prbvolpath": "volpath",
    "direct_projective": "direct",
}
"""Integrators for derivatives, and those whose pictures theirs are."""

_ONLY_OF_DERIVATIVES = ("sppc", "sppp", "sppi", "guiding", "guiding_proj", "guiding_rounds",
                        "project_seed")  # fmt: skip

_WITHOUT_EFFECT = {"bitmap": ("cache", "max_anisotropy"), "hdrfilm": ("attach_log",)}
"""Parameters of Mitsuba 0.x that change no expected picture."""

LEAST_ALPHA = 1e-4
"""What Mitsuba takes for a smaller roughness (include/mitsuba/render/microfacet.h)."""


def adapt(mi: Any, state: Any) -> list[Note]:
    """Change the description; what was changed."""
    found: list[Note] = []
    for index, node in enumerate(state.nodes):
        props, plugin = node.props, str(node.props.plugin_name())
        if plugin in PRIMAL and node.type.name == "Integrator":
            found.append((index, _primal(props, plugin)))
        elif plugin == "batch" and node.type.name == "Sensor":
            found += _first_of_batch(mi, state, index)
        elif plugin in ("roughconductor", "roughdielectric", "roughplastic"):
            for key in ("alpha", "alpha_u", "alpha_v"):
                value = props.get(key, 1.0)
                if isinstance(value, int | float) and 0.0 <= value < LEAST_ALPHA:
                    props[key] = LEAST_ALPHA
                    found.append((index, f"'{key}' is {value:g}, for which Mitsuba takes 0.0001"))
        elif plugin == "bitmap" and props.get("filter_type", "") in ("trilinear", "ewa"):
            old = props["filter_type"]
            props["filter_type"] = "bilinear"
            found.append((index, f"'{old}' filtering of Mitsuba 0.x becomes bilinear"))
        for key in _WITHOUT_EFFECT.get(plugin, ()):
            if key in props:
                del props[key]
    return found


def _primal(props: Any, plugin: str) -> str:
    new = PRIMAL[plugin]
    for key in _ONLY_OF_DERIVATIVES:
        if key in props:
            del props[key]
    props.set_plugin_name(new)
    note = f"stands for '{plugin}', on both sides"
    if new == "direct":
        return note
    # Mitsuba's default of these (python/ad/integrators/common.py); they show what lights emit at
    # max_depth 0, too.
    depth = props.get("max_depth", 6)
    props["max_depth"] = 1 if depth == 0 else depth
    if plugin == "prbvolpath" and depth != -1:
        note += (
            ", but 'prbvolpath' counts a part of the light of paths that are one edge longer than "
            f"'max_depth' {depth}"
        )
    if plugin == "prb_basic":
        note += ", but 'prb_basic' does not meet lights without a surface"
    return note


def _children(state: Any, props: Any, kind: str) -> list[tuple[str, int]]:
    """The keys and indices of nested elements."""
    values = ((str(key), props[key]) for key in props.keys())  # noqa: SIM118
    references = [(k, v.index()) for k, v in values if type(v).__name__ == "ResolvedReference"]
    return [(k, index) for k, index in references if state.nodes[index].type.name == kind]


def _first_of_batch(mi: Any, state: Any, index: int) -> list[Note]:
    """Its first sensor in place of a batch, with the batch's sampler and its share of the film."""
    batch = state.nodes[index].props
    sensors = _children(state, batch, "Sensor")
    if not sensors:
        return []
    first = mi.Properties(state.nodes[sensors[0][1]].props)
    for kind in ("Film", "Sampler"):
        for key, _ in _children(state, first, kind):
            del first[key]
        for key, child in _children(state, batch, kind)[:1]:
            first[f"{key}_of_batch"] = mi.Properties.ResolvedReference(child)
            if kind == "Film":
                film = state.nodes[child].props
                film["width"] = int(film.get("width", 768)) // len(sensors)
    state.nodes[index].props = first
    return [(index, f"is the first of {len(sensors)} sensors of a batch; the others are left out")]
