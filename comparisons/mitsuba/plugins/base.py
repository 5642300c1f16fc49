"""What plugins share: the base class of BSDFs, parameters, and a scene as integrators call it."""

from collections.abc import Callable, Collection
from typing import Any

import numpy as np

# ---- parameters: textures as objects, colours and numbers as plain values ------------------------


Parameter = Callable[[Any, Any], Any]
"""(interaction, mask) -> the parameter's value there."""


def colour(mi: Any, value: Any) -> Parameter:
    """A parameter that is a colour."""
    if hasattr(value, "eval"):
        return lambda si, active: value.eval(si, active)
    constant = mi.Color3f(value)
    return lambda si, active: constant


def number(mi: Any, value: Any) -> Parameter:
    """A parameter that is a number."""
    if hasattr(value, "eval_1"):
        return lambda si, active: value.eval_1(si, active)
    constant = mi.Float(float(value))
    return lambda si, active: constant


def is_wide(mi: Any) -> bool:
    """Whether the current variant processes many rays at once."""
    return not str(mi.variant()).startswith("scalar")


# ---- scenes: ray queries, lights and size, as our integrators and rungs call them ----------------


class PlainScene:
    """Mitsuba's scene.  `comparisons.mitsuba.lit_scene.LitScene` adds CSG solids to one.

    An integrator that Mitsuba's scene has must not keep this: references in a circle through
    Mitsuba are never freed, and Dr.Jit compiles code for all shapes and materials that exist.

    planes: the ids of meshes that stand in for infinite planes.
    """

    def __init__(self, mi: Any, mi_scene: Any, planes: Collection[str] = ()) -> None:
        self.mi, self.mi_scene, self.planes = mi, mi_scene, frozenset(planes)

    def ray_intersect(self, ray: Any, active: Any = True) -> Any:
        """The first surface interaction along rays with unit directions."""
        return self.trace(ray, active)[0]

    def ray_test(self, ray: Any, active: Any = True) -> Any:
        """Whether anything is hit before `ray.maxt`."""
        return self.mi_scene.ray_test(ray, active)

    def trace(self, ray: Any, active: Any = True) -> tuple[Any, Any]:
        """The first surface interaction, and whether it is on a solid: solids that emit are no
        lights that Mitsuba samples."""
        return self.mi_scene.ray_intersect(ray, active), self.mi.Mask(False)

    def emitted(self, si: Any, active: Any) -> Any:
        """The radiance towards `si.wi` of the hit surface, or of the environment for a miss."""
        emitter = si.emitter(self.mi_scene, active)
        if emitter is None:  # scalar variants
            return self.mi.Color3f(0.0)
        radiance = emitter.eval(si, active)
        return radiance & active if is_wide(self.mi) else radiance

    def emitters(self) -> list[Any]:
        """The lights that Mitsuba samples."""
        return list(self.mi_scene.emitters())

    def shapes(self) -> list[Any]:
        """All shapes, those of the operands too."""
        return [shape for mi_scene in self.all_scenes() for shape in mi_scene.shapes()]

    def reach(self) -> float:
        """The largest coordinate on any shape but `planes`, whose triangles are as large as they
        are far away: see `whitted.clearance`."""
        boxes = [shape.bbox() for shape in self.shapes() if shape.id() not in self.planes]
        ends = np.abs([np.array(end, np.float64) for box in boxes for end in (box.min, box.max)])
        return float(np.max(ends[np.isfinite(ends)], initial=0.0))

    def all_scenes(self) -> list[Any]:
        """Mitsuba's scenes that this one consists of."""
        return [self.mi_scene]


# ---- BSDFs ---------------------------------------------------------------------------------------


def base_class(mi: Any) -> Any:
    """A class for the current variant: a BSDF that wraps another one, as far as its subclass does
    not override it."""

    class PluginBSDF(mi.BSDF):  # type: ignore[misc]
        """A subclass defines `sample` and `eval`, and calls `wrap` when it is made."""

        def wrap(self, nested: Any) -> None:
            """Have the components of another BSDF."""
            self.nested = nested
            self.m_components = [nested.flags(k) for k in range(nested.component_count())]
            self.m_flags = nested.flags()

        def pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.nested.pdf(context, si, wo, active)

        def eval_pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            return self.eval(context, si, wo, active), self.pdf(context, si, wo, active)

        def to_string(self) -> str:
            return f"{type(self).__name__}[{self.nested}]"

    return PluginBSDF
