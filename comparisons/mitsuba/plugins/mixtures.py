"""Blends, masks and two-sided materials whose components can be evaluated one by one, and that
handle perfect mirrors; and products of textures.

Errors of Mitsuba 3.9.1 that these correct: a blend adds the probability of a mirrored direction and
the other material's density there, so that a mirror with weight w reflects
(w + (1 - w) f) / (w + (1 - w) p) of its light, with f the other material's BSDF times cosine in the
mirrored direction and p its pdf there; masks and two-sided materials take the wrong component if
one is selected.  Everything else here is Mitsuba's.
"""

from typing import Any

from comparisons.mitsuba.plugins import base
from comparisons.mitsuba.plugins.base import base_class


def register(mi: Any) -> None:
    """Define the materials for the current variant, and register them."""
    import drjit as dr

    def share(value: Any) -> base.Parameter:
        found = base.number(mi, value)
        return lambda si, active: dr.clip(found(si, active), 0.0, 1.0)

    def one_of(context: Any, component: int) -> Any:
        found = mi.BSDFContext(context.mode)
        found.type_mask, found.component = context.type_mask, component
        return found

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
            found = dr.any(value != 0.0)
            return drawn, dr.select(perfect, value, dr.select(found, smooth, mi.Color3f(0.0)))

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
            self.of = [part for _, part in properties.objects()]
            self.factor = mi.Color3f([float(properties[f"factor_{k}"]) for k in range(3)])
            self.cutoff = float(properties["cutoff"])
            self.follow_v = bool(properties["follow_v"])

        def eval(self, si: Any, active: Any = True) -> Any:
            found = self.factor
            for part in self.of:
                found = found * part.eval(si, active)
            if self.follow_v:
                mirrored = dr.dot(dr.cross(si.dp_du, si.dp_dv), si.sh_frame.n) < 0.0
                green = dr.select(mirrored, 1.0 - found.y, found.y)
                return mi.Color3f(found.x, green, found.z)
            if self.cutoff > 0.0:
                return dr.select(found >= self.cutoff, mi.Color3f(1.0), mi.Color3f(0.0))
            return found

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
