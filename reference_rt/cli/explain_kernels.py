"""Which kernels a scene's picture uses, in words, and which of them are compiled already."""

import re
from collections.abc import Iterable

import numba
from numba import types

from reference_rt.jit.kernel import Signature, is_compiled
from reference_rt.jit.parallel_compile import Call
from reference_rt.rendering.kernels import operation_of
from reference_rt.rendering.scene import Scene
from reference_rt.rendering.warm_up import picture_calls, specialised_calls

Lines = list[tuple[str, str]]

_OPERATIONS = {
    "any_hits": "shadow rays of blocks",
    "area_density": "light densities",
    "background": "radiance",
    "branches": "perfect reflection and refraction",
    "camera_ray": "camera rays",
    "closest_hit": "closest hits",
    "closest_hits": "closest hits of blocks",
    "complete_block": "surface coordinates of hits of blocks",
    "coordinates": "texture coordinates",
    "emitted": "emission",
    "environment_density": "light densities",
    "enters": "sides of crossings",
    "eval_pdf": "scattering and density",
    "evaluate": "colours",
    "face": "faces",
    "film_offset": "sample offsets",
    "gradient": "slopes",
    "holds": "which lights",
    "intersect": "crossings",
    "most": "most layers",
    "nearest_of_block": "hits of blocks",
    "nearest_of_type": "hits",
    "number": "layers",
    "occluded": "shadow rays",
    "owner": "ids",
    "pdf": "light densities",
    "prepare": "weights and frames",
    "sample": "samples",
    "sample_fixed": "light of fixed points",
    "surface": "surface points",
    "uv": "texture coordinates",
}
"""Operations whose names say too little."""

_TABLES = {
    "Areas": "area lights",
    "BoxSetup": "filter",
    "Environment": "constant environment",
    "Tabulated": "filter",
    "TentSetup": "filter",
    "Transparents": "dielectrics",
}
"""Classes of tables, likewise."""

_DRIVERS = {
    "render_tile": "driver of the picture",
    "first_hits_tile": "driver of albedo and normal",
    "aov_tile": "driver of ray casting",
}


def kernels_of(scene: Scene) -> Lines:
    """(what, which kernels): those of a scene's picture, linked and specialised."""
    if numba.config.DISABLE_JIT:
        return [("kernels", "NUMBA_DISABLE_JIT is set: they run as plain Python")]
    linked, specialised = picture_calls(scene), specialised_calls(scene)
    if all(is_compiled(*call) for call in specialised):
        use = "this scene is rendered by them"
    else:
        use = "a long render compiles them meanwhile, `warm-up` with this scene beforehand"
    lines = [
        ("linked", f"{_compiled(linked)}; shared by all scenes"),
        ("specialised", f"{_compiled(specialised)}: {use}"),
    ]
    found: dict[str, set[str]] = {}
    for compiled, signature in linked:
        what, operation = _named(operation_of(compiled), signature)
        found.setdefault(what, set()).add(operation)
    return lines + [(what, ", ".join(sorted(of_type))) for what, of_type in sorted(found.items())]


def _compiled(calls: Iterable[Call]) -> str:
    found = [is_compiled(*call) for call in calls]
    return f"{sum(found)} of {len(found)} compiled"


def _named(kernel: str, signature: Signature) -> tuple[str, str]:
    """(the table that a kernel works on, what it computes);  of a driver, which loops over pixels:
    (what it computes, the integrator and the sampler that it has inside)."""
    arguments = signature if isinstance(signature, tuple) else signature.args
    if not isinstance(arguments[0], types.CPointer):
        classes = [getattr(of, "instance_class", type(None)).__name__ for of in arguments]
        inside = [name.removesuffix("Setup").lower() for name in classes if name.endswith("Setup")]
        return _DRIVERS.get(kernel, _words(kernel)), ", ".join(inside) or "one ray per pixel"
    table = arguments[0].dtype.instance_class.__name__
    name = kernel.strip("_").removesuffix("_nested")
    return _TABLES.get(table, _words(table)), _OPERATIONS.get(name, _words(name))


def _words(name: str) -> str:
    """Of a name in either case: `RoughConductors` and `rough_conductors` become words."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])|_", " ", name).strip().lower()
