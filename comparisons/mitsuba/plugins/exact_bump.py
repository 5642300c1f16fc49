"""Bump maps in the place of Mitsuba's own, which are wrong: `{"type": "exact_bump"}`.

Mitsuba 3.9.1 builds the tangent of the tilted frame from a local normal and a world-space
derivative (src/bsdfs/bumpmap.cpp), which anisotropic materials show.  Where the map is flat the
local normal is (0, 0, 1): if u runs along the z axis too, the tangent is 0 / 0, and so is all light
but that of diffuse materials.  And where a texture's coordinates are rotated, it rotates the
gradient before it multiplies by the image's width and height (src/textures/bitmap.cpp), which is
wrong unless these are the same.  It turns the tilted normal to the side of the geometric one, which
is the wrong side where a mesh's triangle is wound against the normals of its vertices: black.

The law is Blinn's (1978): the normal of the surface whose points are raised by the height, of which
the derivatives of the position are dp/du + n dh/du and dp/dv + n dh/dv.
"""

from typing import Any

from comparisons.mitsuba.plugins.base import base_class


def register(mi: Any) -> None:
    """Define the material for the current variant, and register it."""
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
