"""Materials that Mitsuba lacks, and those whose own it gets wrong: `textbook_phong`, `gltf_pbr`;
blends, masks and two-sided materials; products of textures.
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


def _phong(mi: Any) -> None:
    """Phong and Blinn-Phong shading as a Mitsuba material: `{"type": "textbook_phong"}`.

    f cos = k_d cos + k_s max(0, e·r)^p, or (h·n)^p, on the front side; a mirror of colour k_r.
    k_a, the ambient colour, is not part of the BSDF: `eval` returns it for a context of the type
    AMBIENT alone, also through materials that contain this one.
    """
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


def _mixtures(mi: Any) -> None:
    """Blends, masks and two-sided materials whose components can be evaluated one by one, and that
    handle perfect mirrors; and products of textures.

    Errors of Mitsuba 3.9.1 that these correct: a blend adds the probability of a mirrored direction
    and the other material's density there, so that a mirror with weight w reflects (w + (1 - w) f)
    / (w + (1 - w) p) of its light, with f the other material's BSDF times cosine in the mirrored
    direction and p its pdf there; masks and two-sided materials take the wrong component if one is
    selected.  Everything else here is Mitsuba's.
    """
    import drjit as dr

    def share(value: Any) -> base.Parameter:
        at = base.number(mi, value)
        return lambda si, active: dr.clip(at(si, active), 0.0, 1.0)

    def one_of(context: Any, component: int) -> Any:
        chosen = mi.BSDFContext(context.mode)
        chosen.type_mask, chosen.component = context.type_mask, component
        return chosen

    class MixtureBlend(base_class(mi)):  # type: ignore[misc]
        """(1 - weight) first + weight second, the two nested materials."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            # By any names, in order, as Mitsuba's own.
            self.nested = tuple(
                bsdf for _, bsdf in properties.objects() if isinstance(bsdf, mi.BSDF)
            )
            self.weight = share(properties["weight"])
            self.first_count = self.nested[0].component_count()
            self.m_components = [
                bsdf.flags(k) for bsdf in self.nested for k in range(bsdf.component_count())
            ]
            self.m_flags = self.nested[0].flags() | self.nested[1].flags()

        def shares(self, si: Any, active: Any) -> tuple[Any, Any]:
            weight = self.weight(si, active)
            return 1.0 - weight, weight

        def part(self, context: Any) -> tuple[int, Any]:
            """Which of the two has the context's component, and the context for it."""
            k = context.component
            which = 0 if k < self.first_count else 1
            return which, one_of(context, k - which * self.first_count)

        def sample(
            self, context: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
        ) -> tuple[Any, Any]:
            shares = self.shares(si, active)
            if context.component != 0xFFFFFFFF:
                which, inner = self.part(context)
                drawn, value = self.nested[which].sample(inner, si, sample1, sample2, active)
                return drawn, value * shares[which]
            rest, weight = shares
            take = sample1 < weight
            inner1 = dr.select(
                take,
                sample1 / dr.maximum(weight, 1e-20),
                (sample1 - weight) / dr.maximum(rest, 1e-20),
            )
            drawn0, value0 = self.nested[0].sample(context, si, inner1, sample2, active)
            drawn1, value1 = self.nested[1].sample(context, si, inner1, sample2, active)
            drawn = dr.select(take, drawn1, drawn0)
            value = dr.select(take, value1, value0)
            perfect = mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta)
            all_value, all_pdf = self.eval_pdf(context, si, drawn.wo, active)
            smooth = dr.select(
                all_pdf > 0.0, all_value / dr.maximum(all_pdf, 1e-30), mi.Color3f(0.0)
            )
            drawn.pdf = dr.select(perfect, drawn.pdf * dr.select(take, weight, rest), all_pdf)
            scatters = dr.any(value != 0.0)
            return drawn, dr.select(perfect, value, dr.select(scatters, smooth, mi.Color3f(0.0)))

        def eval(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            shares = self.shares(si, active)
            if context.component != 0xFFFFFFFF:
                which, inner = self.part(context)
                return self.nested[which].eval(inner, si, wo, active) * shares[which]
            first, second = (bsdf.eval(context, si, wo, active) for bsdf in self.nested)
            return first * shares[0] + second * shares[1]

        def pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            shares = self.shares(si, active)
            first, second = (bsdf.pdf(context, si, wo, active) for bsdf in self.nested)
            return first * shares[0] + second * shares[1]

        def to_string(self) -> str:
            return f"MixtureBlend[{self.nested[0]}, {self.nested[1]}]"

    class MixtureMask(base_class(mi)):  # type: ignore[misc]
        """Mitsuba's own mask, with the right single components."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.base = properties["base"]
            self.opacity = share(properties["opacity"])
            mask = {"type": "mask", "opacity": properties["opacity"], "base": self.base}
            self.wrap(mi.load_dict(mask))

        def sample(
            self, context: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
        ) -> tuple[Any, Any]:
            if context.component == 0xFFFFFFFF:
                drawn, value = self.nested.sample(context, si, sample1, sample2, active)
                return drawn, value
            opacity = self.opacity(si, active)
            last = len(self.m_components) - 1
            if context.component != last:
                drawn, value = self.base.sample(context, si, sample1, sample2, active)
                return drawn, value * opacity
            drawn = dr.zeros(mi.BSDFSample3f)
            drawn.wo, drawn.eta, drawn.pdf = -si.wi, 1.0, 1.0
            drawn.sampled_type, drawn.sampled_component = +mi.BSDFFlags.Null, last
            return drawn, mi.Color3f(1.0 - opacity)

        def eval(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.nested.eval(context, si, wo, active)

    class MixtureSides(base_class(mi)):  # type: ignore[misc]
        """Mitsuba's own `twosided` with the right single components.

        Seen from behind, Mitsuba numbers the components less the front's: of the front's last one
        remains -1, which selects all (`TwoSidedBRDF::sample`).
        """

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            front, back = properties["front"], properties["back"]
            # Mitsuba makes one object of equal materials, and numbers its components alike.
            self.front_count = 0 if front is back else front.component_count()
            self.wrap(mi.load_dict({"type": "twosided", "0_front": front, "1_back": back}))

        def sample(
            self, context: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
        ) -> tuple[Any, Any]:
            drawn, value = self.nested.sample(context, si, sample1, sample2, active)
            if context.component < self.front_count:
                value = dr.select(si.wi.z > 0.0, value, 0.0)
            return drawn, value

        def eval(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.nested.eval(context, si, wo, active)

    class TextureProduct(mi.Texture):  # type: ignore[misc]
        """The product of nested textures and of factor_0, factor_1, factor_2.

        cutoff: above 0, values of at least this become 1, all others 0;  follow_v: of a normal map,
        whether green is turned where uv is mirrored on the surface, as `NormalMap` describes.
        """

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            # By name: the parser leaves constant colours as numbers, which are no objects.
            names = [name for name, _ in properties.items() if name.startswith("of_")]
            self.of = [properties.get_unbounded_texture(name) for name in names]
            self.factor = mi.Color3f([float(properties[f"factor_{k}"]) for k in range(3)])
            self.cutoff = float(properties["cutoff"])
            self.follow_v = bool(properties["follow_v"])

        def eval(self, si: Any, active: Any = True) -> Any:
            value = self.factor
            for part in self.of:
                value = value * part.eval(si, active)
            if self.follow_v:
                mirrored = dr.dot(dr.cross(si.dp_du, si.dp_dv), si.sh_frame.n) < 0.0
                green = dr.select(mirrored, 1.0 - value.y, value.y)
                return mi.Color3f(value.x, green, value.z)
            if self.cutoff > 0.0:
                return dr.select(value >= self.cutoff, mi.Color3f(1.0), mi.Color3f(0.0))
            return value

        def eval_3(self, si: Any, active: Any = True) -> Any:
            return self.eval(si, active)

        def eval_1(self, si: Any, active: Any = True) -> Any:
            rgb = self.eval(si, active)
            return 0.2126 * rgb.x + 0.7152 * rgb.y + 0.0722 * rgb.z

        def mean(self) -> Any:
            return mi.Float(0.5)  # of use to sampling alone

        def is_spatially_varying(self) -> bool:
            return True

        def to_string(self) -> str:
            return f"TextureProduct[{', '.join(map(str, self.of))}]"

    mi.register_texture("texture_product", TextureProduct)
    mi.register_bsdf("mixture_blend", MixtureBlend)
    mi.register_bsdf("mixture_mask", MixtureMask)
    mi.register_bsdf("mixture_sides", MixtureSides)


GLTF_COLOURS = ("base_color", "specular_color")
GLTF_NUMBERS = ("metallic", "roughness", "specular")


def _gltf_pbr(mi: Any) -> None:
    """glTF's metallic-roughness material as a Mitsuba material: `{"type": "gltf_pbr"}`.

    Written from appendix B of the glTF 2.0 specification and from the extensions KHR_materials_ior
    and KHR_materials_specular, whose names the functions have.  Mitsuba's own `principled` has
    other lobes.
    """
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
            self.parameters = {n: base.colour(mi, properties[n]) for n in GLTF_COLOURS}
            self.parameters |= {n: base.number(mi, properties[n]) for n in GLTF_NUMBERS}
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


def register(mi: Any) -> None:
    """Define the materials for the current variant, and register them."""
    for define in (_phong, _mixtures, _gltf_pbr):
        define(mi)
