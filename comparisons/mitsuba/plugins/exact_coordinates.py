"""Bump maps, and coordinates of curved surfaces, in the place of those of Mitsuba.

Bump maps, since Mitsuba's own are wrong: `{"type": "exact_bump"}`.

Mitsuba 3.9.1 builds the tangent of the tilted frame from a local normal and a world-space
derivative (src/bsdfs/bumpmap.cpp), which anisotropic materials show.  Where the map is flat the
local normal is (0, 0, 1): if the tangent is the z axis itself, the new one is 0 / 0; metals are
black then, and a diffuse surface has 0.18 of its light.  And where a texture's coordinates are
rotated, it rotates the gradient before it multiplies by the image's width and height
(src/textures/bitmap.cpp), which is wrong unless these are the same.  It turns the tilted normal to
the side of the geometric one, which is the wrong side where a mesh's triangle is wound against the
normals of its vertices: black.

The law is Blinn's (1978): the normal of the surface whose points are raised by the height, of which
the derivatives of the position are dp/du + n dh/du and dp/dv + n dh/dv.

A material on a mesh that stands in for a curved surface: `{"type": "exact_coordinates"}`.

Between the vertices of a mesh Mitsuba interpolates uv, and it takes the derivatives of the position
by u and v as constant on each triangle.  Where a cone narrows by a tenth within a triangle, the
slopes of a bump map are a tenth off.  Where the angle around the axis does not change along a line
of constant z, as on the diagonals of a saddle, the tangents of a mesh have any direction.

This plugin gives the nested material the surface's own uv and derivatives, computed at the point
that was hit, and the shading frame whose x axis follows dp/du.
It is not for instances, in which it does not know the place of the surface.

A texture by a mesh's further texture coordinates, of which Mitsuba has none: attributes of vertices
in their place, `{"type": "texture_of_set"}`.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from comparisons.mitsuba.plugins import base
from comparisons.mitsuba.plugins.base import base_class
from reference_rt.core.arrays import FloatArray


def _register_bump(mi: Any) -> None:
    import drjit as dr

    def facing(n: Any, v: Any) -> Any:
        """The tilted normal; where it faces away from v as the surface does not, turned by half a
        turn about the surface's own."""
        away = v.z * dr.dot(v, n) <= 0.0
        return dr.select(away, mi.Vector3f(-n.x, -n.y, n.z), n)

    def shadow(n: Any, v: Any) -> Any:
        """The masking of light from v that takes the place of a hard line (Estevez, Lecocq and
        Stein 2019)."""
        across = dr.square(n.x) + dr.square(n.y)
        alpha2 = dr.minimum(0.125 * across / dr.maximum(dr.square(n.z), 1e-20), 1.0)
        z = dr.abs(v.z)
        root = dr.sqrt(dr.square(z) + alpha2 * (dr.square(v.x) + dr.square(v.y)))
        return dr.select(alpha2 > 0.0, 2.0 * z / dr.maximum(z + root, 1e-20), 1.0)

    class ExactBump(base_class(mi)):  # type: ignore[misc]
        """Parameters: base;  height, a texture in its own coordinates;  u_u, u_v, u_1, v_u, v_v,
        v_1, these from a surface's: u' = u_u u + u_v v + u_1;  scale, flip_invalid_normals and
        use_shadowing_function as in Mitsuba's `bumpmap`."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.wrap(properties["base"])
            self.height = properties["height"]
            self.m = [properties[name] for name in ("u_u", "u_v", "u_1", "v_u", "v_v", "v_1")]
            self.scale = properties["scale"]
            self.flips = properties["flip_invalid_normals"]
            self.shadows = properties["use_shadowing_function"]

        def tilted(self, si: Any, active: Any) -> tuple[Any, Any]:
            """The interaction with the tilted frame, and the tilted normal in the untilted one."""
            there = mi.SurfaceInteraction3f(si)
            m, uv = self.m, si.uv
            there.uv = mi.Point2f(
                m[0] * uv.x + m[1] * uv.y + m[2], m[3] * uv.x + m[4] * uv.y + m[5]
            )
            slope = self.scale * self.height.eval_1_grad(there, active)
            dh_du = slope.x * m[0] + slope.y * m[3]
            dh_dv = slope.x * m[1] + slope.y * m[4]
            normal = si.sh_frame.n
            dp_du = si.dp_du + normal * (dh_du - dr.dot(normal, si.dp_du))
            dp_dv = si.dp_dv + normal * (dh_dv - dr.dot(normal, si.dp_dv))
            n = dr.normalize(dr.cross(dp_du, dp_dv))
            wrong_side = dr.dot(n, si.n) * dr.dot(normal, si.n) < 0.0
            n = dr.select(wrong_side, -n, n)
            local = si.to_local(n)
            if self.flips:
                local = facing(local, si.wi)
                n = si.to_world(local)
            there.uv = uv
            s = dr.normalize(si.dp_du - n * dr.dot(n, si.dp_du))
            frame = mi.Frame3f()
            frame.s, frame.t, frame.n = s, dr.cross(n, s), mi.Normal3f(n)
            there.sh_frame = frame
            there.wi = there.to_local(si.to_world(si.wi))
            return there, local

        def sees(self, si: Any, there: Any, v: Any) -> Any:
            """The local v in the tilted frame, and whether both frames have it on the same side."""
            tilted = there.to_local(si.to_world(v))
            return tilted, v.z * tilted.z > 0.0

        def factor(self, n: Any, v: Any) -> Any:
            return shadow(n, v) if self.shadows else 1.0

        def sample(
            self, context: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
        ) -> tuple[Any, Any]:
            there, n = self.tilted(si, active)
            drawn, value = self.nested.sample(context, there, sample1, sample2, active)
            wo = si.to_local(there.to_world(drawn.wo))
            valid = wo.z * drawn.wo.z > 0.0
            drawn.wo = wo
            drawn.pdf = dr.select(valid, drawn.pdf, 0.0)
            return drawn, dr.select(valid, value * self.factor(n, wo), 0.0)

        def eval(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            there, n = self.tilted(si, active)
            tilted, valid = self.sees(si, there, wo)
            value = self.nested.eval(context, there, tilted, active)
            return dr.select(valid, value * self.factor(n, wo), 0.0)

        def pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            there, _ = self.tilted(si, active)
            tilted, valid = self.sees(si, there, wo)
            return dr.select(valid, self.nested.pdf(context, there, tilted, active), 0.0)

    mi.register_bsdf("exact_bump", ExactBump)


# ---- u and v of curved surfaces, and the derivatives of the position by them ---------------------
# On a mesh Mitsuba interpolates uv between vertices, and takes the derivatives as constant on each
# triangle. These here are exact, and defined for points off the surface, too. They are written for
# numbers of NumPy and of Dr.Jit alike: the plugin uses them, and its error is measured with them.


Triple = tuple[Any, Any, Any]

FULL = 2.0 * math.pi


class Maths(NamedTuple):
    """Functions of the numbers in use."""

    sqrt: Callable[[Any], Any]
    atan2: Callable[[Any, Any], Any]
    select: Callable[[Any, Any, Any], Any]

    def turns(self, y: Any, x: Any) -> Any:
        """The angle of (x, y), from 0 to 1."""
        share = self.atan2(y, x) / FULL
        return self.select(share < 0.0, share + 1.0, share)


NUMPY = Maths(np.sqrt, np.arctan2, np.where)


class Round(NamedTuple):
    """A torus around the z axis, or a sphere.  origin (3,): its middle;  major: the radius of the
    circle in the middle of the tube, 0 for a sphere, whose v goes down from pole to pole."""

    origin: tuple[float, float, float]
    major: float
    is_sphere: bool = False

    def numbers(self) -> dict[str, float]:
        """The parameters of the plugin."""
        return {"major": self.major, "is_sphere": float(self.is_sphere)}

    def uv(self, p: Triple, maths: Maths) -> tuple[Any, Any]:
        """u and v at p, which is seen from the origin."""
        x, y, z = p
        rho = maths.sqrt(x * x + y * y)
        if self.is_sphere:
            return maths.turns(y, x), maths.atan2(rho, z) / math.pi
        return maths.turns(y, x), maths.turns(z, rho - self.major)

    def derivatives(self, p: Triple, maths: Maths) -> tuple[Triple, Triple]:
        """dp/du and dp/dv at p; infinite, or not a number, where there are none."""
        x, y, z = p
        rho = maths.sqrt(x * x + y * y)
        turn = -math.pi if self.is_sphere else FULL
        up = turn / rho
        return (-FULL * y, FULL * x, 0.0 * x), (-up * z * x, -up * z * y, turn * (rho - self.major))


class Level(NamedTuple):
    """The surface f = 0 of a quadratic, with u around the z axis and v along it.

    origin (3,): the middle of a box;  half (3,): its half sides, in units of which u is an angle,
    and v goes from 0 to 1;  slopes (9,): the derivatives of f's gradient, row by row;  gradient
    (3,): f's at the origin.
    """

    origin: tuple[float, float, float]
    half: tuple[float, float, float]
    slopes: tuple[float, ...]
    gradient: tuple[float, float, float]

    def numbers(self) -> dict[str, float]:
        """The parameters of the plugin."""
        every = {"half": self.half, "slope": self.slopes, "gradient": self.gradient}
        return {f"{name}_{k}": x for name, values in every.items() for k, x in enumerate(values)}

    def uv(self, p: Triple, maths: Maths) -> tuple[Any, Any]:
        """As `Round.uv`."""
        (x, y, z), (wide, deep, high) = p, self.half
        return maths.turns(y / deep, x / wide), 0.5 * (z / high + 1.0)

    def derivatives(self, p: Triple, maths: Maths) -> tuple[Triple, Triple]:
        """As `Round.derivatives`.

        Along dp/du neither f nor v changes, along dp/dv neither f nor u.  With a and b for the
        gradients of u and v they are b x f' and f' x a, over a . (b x f').  This is 0 where a line
        of constant z runs towards the axis: u does not change along it.
        """
        x, y, z = p
        m, (gx, gy, gz) = self.slopes, self.gradient
        fx = m[0] * x + m[1] * y + m[2] * z + gx
        fy = m[3] * x + m[4] * y + m[5] * z + gy
        fz = m[6] * x + m[7] * y + m[8] * z + gz
        wide, deep, high = self.half
        across, along = x / wide, y / deep
        ax, ay = -along / wide, across / deep  # a, times 2 pi rho²
        volume = ay * fx - ax * fy
        u = FULL * (across * across + along * along) / volume
        v = 2.0 * high / volume
        return (-u * fy, u * fx, 0.0 * u), (-v * fz * ay, v * fz * ax, v * (fx * ay - fy * ax))


Coordinates = Round | Level


def of_quadric(
    matrix: FloatArray, linear: FloatArray, lower: FloatArray, upper: FloatArray
) -> Level:
    """Of the surface x^T M x + l x + c = 0 in a box."""
    middle = 0.5 * (lower + upper)
    half = 0.5 * (upper - lower)
    return Level(
        origin=_three(middle),
        half=_three(half),
        slopes=tuple((2.0 * matrix).ravel().tolist()),
        gradient=_three(linear + 2.0 * matrix @ middle),
    )


def of_cone(radius: float, slope: float, low: float, height: float) -> Level:
    """Of the surface at the distance radius + slope (z - low) from the z axis, whose v is 0 at
    z = low and 1 at low + height."""
    at_zero = radius - slope * low
    matrix = np.diag([1.0, 1.0, -slope * slope])
    linear = np.array([0.0, 0.0, -2.0 * at_zero * slope])
    lower, upper = np.array([-1.0, -1.0, low]), np.array([1.0, 1.0, low + height])
    return of_quadric(matrix, linear, lower, upper)


def _three(values: FloatArray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def derivatives_at(of: Coordinates, p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """dp/du and dp/dv (n, 3) at points (n, 3), in the shape's own coordinates."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        x, y, z = (p - of.origin).T
        du, dv = of.derivatives((x, y, z), NUMPY)
    return np.column_stack(du), np.column_stack(dv)


# ---- the plugin ----------------------------------------------------------------------------------


def _register_coordinates(mi: Any) -> None:
    import drjit as dr

    maths = Maths(dr.sqrt, dr.atan2, dr.select)

    def number(value: float) -> Any:
        """A number that is not part of the compiled code, which many shapes then share."""
        return dr.opaque(mi.Float, value) if base.is_wide(mi) else value

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


# ---- further texture coordinates of meshes -------------------------------------------------------


def _register_sets(mi: Any) -> None:
    class TextureOfSet(mi.Texture):  # type: ignore[misc]
        """The texture `of` by other coordinates than the surface's: those that a mesh has at its
        vertices as the attribute with this name."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.of = properties["of"]
            self.attribute = str(properties["attribute"])

        def there(self, si: Any, active: Any) -> Any:
            found = mi.SurfaceInteraction3f(si)
            uv = si.shape.eval_attribute_3(self.attribute, si, active)
            found.uv = mi.Point2f(uv.x, uv.y)
            return found

        def eval(self, si: Any, active: Any = True) -> Any:
            return self.of.eval(self.there(si, active), active)

        def eval_3(self, si: Any, active: Any = True) -> Any:
            return self.of.eval_3(self.there(si, active), active)

        def eval_1(self, si: Any, active: Any = True) -> Any:
            return self.of.eval_1(self.there(si, active), active)

        def mean(self) -> Any:
            return self.of.mean()

        def is_spatially_varying(self) -> bool:
            return True

        def to_string(self) -> str:
            return f"TextureOfSet[{self.attribute}, {self.of}]"

    mi.register_texture("texture_of_set", TextureOfSet)


def register(mi: Any) -> None:
    """Define these for the current variant, and register them."""
    _register_bump(mi)
    _register_coordinates(mi)
    _register_sets(mi)
