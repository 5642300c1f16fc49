"""Phong and Blinn-Phong shading as a Mitsuba material: `{"type": "textbook_phong"}`.

f cos = k_d cos + k_s max(0, e·r)^p, or (h·n)^p, on the front side; a mirror of colour k_r.  k_a,
the ambient colour, is not part of the BSDF: `eval` returns it for a context of the type AMBIENT
alone, also through materials that contain this one.
"""

import math
from typing import Any

from comparisons.mitsuba.plugins import base
from comparisons.mitsuba.plugins.base import base_class

AMBIENT = 0x80000000
"""A bit of `BSDFContext.type_mask` that Mitsuba does not use."""

BLANK = 0x40000000
"""Another unused bit: values that a material returns for AMBIENT and BLANK alike are not
ambient."""

_COLOURS = ("ambient", "diffuse", "specular", "mirror")


def register(mi: Any) -> None:
    """Define the material for the current variant, and register it."""
    import drjit as dr

    flags = mi.BSDFFlags
    front = flags.FrontSide
    everything = 0xFFFFFFFF

    class TextbookPhong(base_class(mi)):  # type: ignore[misc]
        """Parameters: ambient, diffuse, specular, mirror (textures); exponent; half_vector."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.colours = {n: base.colour(mi, properties[n]) for n in _COLOURS}
            self.exponent = float(properties.get("exponent", 32.0))
            self.half_vector = bool(properties.get("half_vector", False))
            # The smooth part is one component, sampled from two lobes.
            self.m_components = [
                flags.DiffuseReflection | front,
                flags.DeltaReflection | front,
            ]
            self.m_flags = self.m_components[0] | self.m_components[1]

        def colour(self, name: str, si: Any, active: Any) -> Any:
            return self.colours[name](si, active)

        @staticmethod
        def asked(context: Any, kind: Any, component: int) -> bool:
            kind = int(kind)
            return (context.type_mask & kind) == kind and context.component in (
                everything,
                component,
            )

        def sample(
            self, context: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
        ) -> tuple[Any, Any]:
            smooth = self.asked(context, flags.DiffuseReflection, 0)
            mirror = self.asked(context, flags.DeltaReflection, 1)
            drawn = dr.zeros(mi.BSDFSample3f)
            black = mi.Color3f(0.0)
            if not (smooth or mirror):
                return drawn, black
            seen = si.wi.z > 0.0
            k_r = self.colour("mirror", si, active)
            # The mirror is sampled with probability 1/3, if it is not black.
            share: Any = dr.select(dr.max(k_r) > 0.0, 1.0 / 3.0, 0.0) if smooth else mi.Float(1.0)
            if not mirror:
                share = mi.Float(0.0)
            perfect = sample1 < share
            u = (sample1 - share) / dr.maximum(1.0 - share, 1e-20)
            wo = self.draw(si.wi, u, sample2)
            density = self.density(si.wi, wo)
            value = self.scattered(si, wo, active) / dr.maximum(density, 1e-30)
            good = dr.select(density > 0.0, wo.z > 0.0, False)
            drawn.eta = 1.0
            drawn.wo = dr.select(perfect, mi.reflect(si.wi), wo)
            drawn.pdf = dr.select(perfect, share, density * (1.0 - share))
            drawn.sampled_component = dr.select(perfect, mi.UInt32(1), mi.UInt32(0))
            drawn.sampled_type = dr.select(
                perfect,
                mi.UInt32(int(flags.DeltaReflection)),
                mi.UInt32(int(flags.DiffuseReflection)),
            )
            value = dr.select(good, value / dr.maximum(1.0 - share, 1e-20), black)
            value = dr.select(perfect, k_r / dr.maximum(share, 1e-20), value)
            return drawn, dr.select(seen, value, black)

        def draw(self, wi: Any, u: Any, sample2: Any) -> Any:
            """A direction: with probability 1/2 by the cosine, else by the power of the lobe."""
            p = self.exponent
            cosine = mi.warp.square_to_cosine_hemisphere(sample2)
            z = dr.power(dr.maximum(sample2.x, 1e-20), 1.0 / (p + 1.0))
            r = dr.safe_sqrt(1.0 - z * z)
            sin, cos = dr.sincos(2.0 * math.pi * sample2.y)
            lobe = mi.Vector3f(r * cos, r * sin, z)
            if self.half_vector:
                glossy = 2.0 * dr.dot(wi, lobe) * lobe - wi
            else:
                glossy = mi.Frame3f(mi.reflect(wi)).to_world(lobe)
            return dr.select(u < 0.5, cosine, glossy)

        def density(self, wi: Any, wo: Any) -> Any:
            p = self.exponent
            norm = (p + 1.0) / (2.0 * math.pi)
            cosine = dr.maximum(wo.z, 0.0) / math.pi
            lobe = norm * self.lobe(wi, wo)
            if self.half_vector:
                h = dr.normalize(wi + wo)
                lobe /= 4.0 * dr.maximum(dr.dot(wi, h), 1e-20)
            return 0.5 * (cosine + lobe)

        def lobe(self, wi: Any, wo: Any) -> Any:
            reflected = mi.reflect(wi)
            cosine = dr.normalize(wi + wo).z if self.half_vector else dr.dot(reflected, wo)
            # 0^0 is 1 only where the cosine is not negative.
            power = dr.power(dr.maximum(cosine, 1e-30), self.exponent)
            return dr.select(cosine > 0.0, power, 0.0)

        def scattered(self, si: Any, wo: Any, active: Any) -> Any:
            diffuse = self.colour("diffuse", si, active) * wo.z
            value = diffuse + self.colour("specular", si, active) * self.lobe(si.wi, wo)
            lit = dr.select(si.wi.z > 0.0, wo.z > 0.0, False)
            return dr.select(lit, value, mi.Color3f(0.0))

        def eval(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            if context.type_mask == AMBIENT:
                return self.colour("ambient", si, active)
            if not self.asked(context, flags.DiffuseReflection, 0):
                return mi.Color3f(0.0)
            return self.scattered(si, wo, active)

        def pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            if not self.asked(context, flags.DiffuseReflection, 0):
                return mi.Float(0.0)
            share = 0.0
            if self.asked(context, flags.DeltaReflection, 1):
                lit = dr.max(self.colour("mirror", si, active)) > 0.0
                share = dr.select(lit, 1.0 / 3.0, 0.0)
            front_side = dr.select(si.wi.z > 0.0, wo.z > 0.0, False)
            return dr.select(front_side, self.density(si.wi, wo) * (1.0 - share), 0.0)

        def to_string(self) -> str:
            return f"TextbookPhong[exponent={self.exponent}]"

    mi.register_bsdf("textbook_phong", TextbookPhong)
