"""glTF's metallic-roughness material as a Mitsuba material: `{"type": "gltf_pbr"}`.

Written from appendix B of the glTF 2.0 specification and from the extensions KHR_materials_ior and
KHR_materials_specular, whose names the functions have.  Mitsuba's own `principled` has other lobes.
"""

import math
from typing import Any

from comparisons.mitsuba.plugins import base
from comparisons.mitsuba.plugins.base import base_class

COLOURS = ("base_color", "specular_color")
NUMBERS = ("metallic", "roughness", "specular")


def register(mi: Any) -> None:
    """Define the material for the current variant, and register it."""
    import drjit as dr

    glossy = int(mi.BSDFFlags.GlossyReflection)
    least_alpha = 1e-4

    def schlick(f0: Any, v_dot_h: Any) -> Any:
        return f0 + (1.0 - f0) * dr.power(dr.maximum(1.0 - v_dot_h, 0.0), 5)

    def mix(first: Any, second: Any, weight: Any) -> Any:
        return first * (1.0 - weight) + second * weight

    class GltfPbr(base_class(mi)):  # type: ignore[misc]
        """Parameters: base_color, specular_color, metallic, roughness, specular (textures); ior."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.parameters = {n: base.colour(mi, properties[n]) for n in COLOURS}
            self.parameters |= {n: base.number(mi, properties[n]) for n in NUMBERS}
            ior = float(properties.get("ior", 1.5))
            self.f0 = ((1.0 - ior) / (1.0 + ior)) ** 2
            # Both lobes are one component.
            self.m_components = [mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide]
            self.m_flags = self.m_components[0]

        def parameter(self, name: str, si: Any, active: Any) -> Any:
            return self.parameters[name](si, active)

        @staticmethod
        def lit(context: Any, wi: Any, wo: Any) -> Any:
            """Whether light passes from wo to wi, in the components that are asked for."""
            asked = context.type_mask & glossy == glossy and context.component in (0, 0xFFFFFFFF)
            return dr.select(wi.z > 0.0, wo.z > 0.0, False) & asked

        def alpha(self, si: Any, active: Any) -> Any:
            roughness = self.parameter("roughness", si, active)
            return dr.maximum(roughness * roughness, least_alpha)

        def specular_brdf(self, alpha: Any, v: Any, light: Any, h: Any) -> Any:
            """Vis * D.  (N·H)² (alpha² - 1) + 1 is sin² + alpha² cos², without cancellation."""
            a2 = alpha * alpha
            n_v, n_l = dr.maximum(v.z, 1e-20), dr.maximum(light.z, 1e-20)
            norm = h.x * h.x + h.y * h.y + a2 * h.z * h.z
            d = a2 / (math.pi * norm * norm)
            root_v, root_l = (dr.sqrt(a2 + (1.0 - a2) * n * n) for n in (n_v, n_l))
            return d * 0.5 / (n_v * root_l + n_l * root_v)

        def brdf(self, si: Any, wo: Any, active: Any) -> Any:
            colour, metallic = (self.parameter(n, si, active) for n in ("base_color", "metallic"))
            h = dr.normalize(si.wi + wo)
            v_dot_h = dr.abs(dr.dot(si.wi, h))
            specular = self.specular_brdf(self.alpha(si, active), si.wi, wo, h)
            metal_brdf = specular * schlick(colour, v_dot_h)
            fr = schlick(self.f0 * self.parameter("specular_color", si, active), v_dot_h)
            weight = self.parameter("specular", si, active)
            diffuse_brdf = colour / math.pi
            dielectric_brdf = (1.0 - weight * dr.max(fr)) * diffuse_brdf + weight * fr * specular
            return mix(dielectric_brdf, metal_brdf, metallic)

        def lobes(self, si: Any, active: Any) -> tuple[Any, Any]:
            """The distribution of visible normals, and the probability of it."""
            alpha = self.alpha(si, active)
            normals = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, alpha, True)
            metallic = self.parameter("metallic", si, active)
            return normals, mix(0.5, 0.95, metallic)

        def density(self, si: Any, wo: Any, active: Any) -> Any:
            normals, share = self.lobes(si, active)
            h = dr.normalize(si.wi + wo)
            mirrored = normals.pdf(si.wi, h) / dr.maximum(4.0 * dr.dot(si.wi, h), 1e-20)
            return mix(dr.maximum(wo.z, 0.0) / math.pi, mirrored, share)

        def sample(
            self, context: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
        ) -> tuple[Any, Any]:
            normals, share = self.lobes(si, active)
            h, _ = normals.sample(si.wi, sample2)
            mirrored = 2.0 * dr.dot(si.wi, h) * mi.Vector3f(h) - si.wi
            cosine = mi.warp.square_to_cosine_hemisphere(sample2)
            drawn = dr.zeros(mi.BSDFSample3f)
            drawn.wo = dr.select(sample1 < share, mirrored, cosine)
            drawn.eta, drawn.sampled_component, drawn.sampled_type = 1.0, 0, glossy
            drawn.pdf = self.pdf(context, si, drawn.wo, active)
            value = self.eval(context, si, drawn.wo, active) / dr.maximum(drawn.pdf, 1e-30)
            return drawn, dr.select(drawn.pdf > 0.0, value, mi.Color3f(0.0))

        def eval(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            value = self.brdf(si, wo, active) * wo.z
            return dr.select(self.lit(context, si.wi, wo), value, mi.Color3f(0.0))

        def pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            density = self.density(si, wo, active)
            return dr.select(self.lit(context, si.wi, wo), density, 0.0)

        def to_string(self) -> str:
            return f"GltfPbr[f0={self.f0}]"

    mi.register_bsdf("gltf_pbr", GltfPbr)
