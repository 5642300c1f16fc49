"""A material on a mesh that stands in for a curved surface: `{"type": "exact_coordinates"}`.

Between the vertices of a mesh Mitsuba interpolates uv, and it takes the derivatives of the position
by u and v as constant on each triangle.  Where a cone narrows by a tenth within a triangle, the
slopes of a bump map are a tenth off.  Where the angle around the axis does not change along a line
of constant z, as on the diagonals of a saddle, the tangents of a mesh have any direction.

This plugin gives the nested material the surface's own uv and derivatives, computed at the point
that was hit (`comparisons.mitsuba.coordinates`), and the shading frame whose x axis follows dp/du.
It is not for instances, in which it does not know the place of the surface.
"""

from typing import Any

from comparisons.mitsuba.coordinates import Level, Maths, Round
from comparisons.mitsuba.plugins import parameters
from comparisons.mitsuba.plugins.base import base_class


def register(mi: Any) -> None:
    """Define the material for the current variant, and register it."""
    import drjit as dr

    maths = Maths(dr.sqrt, dr.atan2, dr.select)

    def number(value: float) -> Any:
        """A number that is not part of the compiled code, which many shapes then share."""
        return dr.opaque(mi.Float, value) if parameters.is_wide(mi) else value

    class ExactCoordinates(base_class(mi)):  # type: ignore[misc]
        """Parameters: nested;  m_00 to m_22, the linear part of the shape's map to the world;  i_00
        to i_22, its inverse;  o_0 to o_2, the world's place of the surface's origin;  `numbers` of
        the surface's `Coordinates`."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.wrap(properties["nested"])

            def read(*names: str) -> list[Any]:
                return [number(float(properties[name])) for name in names]

            self.m, self.i = (
                read(*(f"{x}_{j}{k}" for j in range(3) for k in range(3))) for x in "mi"
            )
            self.o = read("o_0", "o_1", "o_2")
            unused = (0.0, 0.0, 0.0)  # the origin is in `o`
            self.of: Any
            if "major" in properties:
                self.of = Round(unused, read("major")[0], properties["is_sphere"] > 0.0)
            else:
                sizes = {"half": 3, "slope": 9, "gradient": 3}
                self.of = Level(
                    unused,
                    *(tuple(read(*(f"{x}_{k}" for k in range(n)))) for x, n in sizes.items()),
                )

        def there(self, si: Any) -> tuple[Any, Any, Any]:
            """The interaction with exact coordinates, and the components of its frame's x axis
            along the axes of the frame that it had."""
            p = si.p - mi.Vector3f(*self.o)
            i, m = self.i, self.m
            local = tuple(
                i[3 * k] * p.x + i[3 * k + 1] * p.y + i[3 * k + 2] * p.z for k in range(3)
            )
            dp_du, dp_dv = (
                mi.Vector3f(
                    *(m[3 * k] * d[0] + m[3 * k + 1] * d[1] + m[3 * k + 2] * d[2] for k in range(3))
                )
                for d in self.of.derivatives(local, maths)
            )
            old = si.sh_frame
            s = dp_du / dr.max(dr.abs(dp_du))
            x, y = dr.dot(old.s, s), dr.dot(old.t, s)
            size = dr.sqrt(x * x + y * y)
            x, y = x / size, y / size
            # Where u is no coordinate of the surface, as at an apex, the triangle's tangents stay.
            known = dr.isfinite(x) & dr.isfinite(y) & dr.isfinite(dr.squared_norm(dp_dv))
            x, y = dr.select(known, x, 1.0), dr.select(known, y, 0.0)
            there = mi.SurfaceInteraction3f(si)
            there.uv = mi.Point2f(*self.of.uv(local, maths))
            there.dp_du = dr.select(known, dp_du, si.dp_du)
            there.dp_dv = dr.select(known, dp_dv, si.dp_dv)
            frame = mi.Frame3f()
            frame.s, frame.t, frame.n = old.s * x + old.t * y, old.t * x - old.s * y, old.n
            there.sh_frame = frame
            there.wi = self.turned(si.wi, x, y)
            return there, x, y

        @staticmethod
        def turned(v: Any, x: Any, y: Any) -> Any:
            """A local vector in a frame whose x axis has the components x and y."""
            return mi.Vector3f(v.x * x + v.y * y, v.y * x - v.x * y, v.z)

        def sample(
            self, context: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
        ) -> tuple[Any, Any]:
            there, x, y = self.there(si)
            drawn, value = self.nested.sample(context, there, sample1, sample2, active)
            drawn.wo = self.turned(drawn.wo, x, -y)
            return drawn, value

        def eval(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            there, x, y = self.there(si)
            return self.nested.eval(context, there, self.turned(wo, x, y), active)

        def pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            there, x, y = self.there(si)
            return self.nested.pdf(context, there, self.turned(wo, x, y), active)

    mi.register_bsdf("exact_coordinates", ExactCoordinates)
