"""An area light with a texture on any shape as a Mitsuba emitter: `{"type": "textured_area"}`.

Mitsuba's own samples a texture's uv in proportion to its brightness, and looks for the place of the
surface with these uv: on a mesh there may be none, or several.  This one samples the surface by
area.
"""

from typing import Any

from comparisons.mitsuba.plugins import parameters


def register(mi: Any) -> None:
    """Define the emitter for the current variant, and register it."""
    import drjit as dr

    class TexturedArea(mi.Emitter):  # type: ignore[misc]
        """Parameter: radiance, a texture of uv."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.radiance = properties["radiance"]
            self.m_flags = mi.EmitterFlags.Surface | mi.EmitterFlags.SpatiallyVarying

        def eval(self, si: Any, active: Any = True) -> Any:
            shines = mi.Frame3f.cos_theta(si.wi) > 0.0
            return dr.select(shines, self.radiance.eval(si, active), 0.0)

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            """A point of the surface by area; only its front shines."""
            ds = self.get_shape().sample_direction(it, sample, active)
            wide = parameters.is_wide(mi)
            ds.emitter = mi.EmitterPtr(self) if wide else self
            value = self.eval_direction(it, ds, active) / dr.maximum(ds.pdf, 1e-30)
            return ds, dr.select(ds.pdf > 0.0, value, 0.0)

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            shines = dr.dot(ds.d, ds.n) < 0.0
            return dr.select(shines, self.get_shape().pdf_direction(it, ds, active), 0.0)

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            wide = parameters.is_wide(mi)
            si = dr.zeros(mi.SurfaceInteraction3f) if wide else mi.SurfaceInteraction3f()
            si.uv = ds.uv
            shines = dr.dot(ds.d, ds.n) < 0.0
            return dr.select(shines, self.radiance.eval(si, active), 0.0)

        def to_string(self) -> str:
            return "TexturedArea[]"

    mi.register_emitter("textured_area", TexturedArea)
