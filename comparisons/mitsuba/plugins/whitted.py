"""Whitted's ray tracing as a Mitsuba integrator: `{"type": "whitted"}`.

Twin of `reference_rt.integrators.whitted`: ambient light; direct light from every light that is a
point or a direction, and from one point of every area light; every mirrored and refracted ray, and
those that go straight on; the background.  Intersections, visibility, BSDFs, Fresnel terms and
emission are Mitsuba's own.

A BSDF is asked for each of its components alone, which leaves nothing to chance: what is a
direction of its own is followed, the rest is the smooth part, which lights are multiplied with.

Where a ray starts differs from Mitsuba's integrators.  They move it off the surface by 1e-4 of the
scene's coordinates, which moves what it meets by as much or more: a hundred times float32's own
error, and enough to hide a wrong direction.  Here it is moved by float32's error alone.
"""

from typing import Any

import numpy as np

from comparisons.mitsuba.plugins import parameters, phong
from comparisons.mitsuba.plugins.light_points import light_points

_ROUNDINGS = 8.0 * 2.0**-24
"""How far a point lies off its surface, over the scene's largest coordinate: as the bound in
`comparisons.rungs.rays.bounds`, of which a third was measured."""


def clearance(mi: Any, si: Any, reach: float, rough: Any) -> Any:
    """How far off its surface a ray begins; `reach` is the scene's largest coordinate.  Never
    farther than Mitsuba begins its own; and as far where `rough`."""
    import drjit as dr

    own = (1.0 + dr.max(dr.abs(si.p))) * mi.math.RayEpsilon
    return dr.select(rough, own, dr.minimum(own, _ROUNDINGS * reach))


def leave(mi: Any, si: Any, d: Any, height: Any) -> Any:
    """A ray from a surface along the unit `d`, begun at `height` over it.

    It is moved along itself, which keeps it on its line; at grazing angles, where this would carry
    it past what stands near, by ten heights at most, and for the rest along the normal.
    """
    import drjit as dr

    cosine = dr.dot(d, si.n)
    along = height / dr.maximum(dr.abs(cosine), 0.1)
    rest = dr.copysign(height, cosine) - along * cosine
    return mi.Ray3f(si.p + d * along + si.n * rest, d, si.time, si.wavelengths)


def emitted(mi: Any, scene: Any, si: Any, active: Any) -> Any:
    """The radiance that arrives from what a ray hit, the environment where it hit nothing."""
    emitter = si.emitter(scene, active)
    if emitter is None:  # scalar variants
        return mi.Color3f(0.0)
    return emitter.eval(si, active) & active if parameters.is_wide(mi) else emitter.eval(si, active)


def without(mask: Any, other: Any) -> Any:
    """mask and not other; `~` would make numbers of the plain bools of scalar variants."""
    import drjit as dr

    return dr.select(other, False, mask)


def register(mi: Any) -> None:
    """Define the integrator for the variant that is set, and register it."""
    import drjit as dr

    class Whitted(mi.SamplingIntegrator):  # type: ignore[misc]
        """Parameters: max_depth, most mirrorings and refractions of a ray; min_contribution, the
        fraction of the pixel below which a ray is not followed; components, at least as many as
        any BSDF has; unlit, the ids, with spaces between, of shapes that are no lights although
        they shine; ambient_r, ambient_g, ambient_b, the ambient light's radiance."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.max_depth = properties.get("max_depth", 8)
            self.min_contribution = properties.get("min_contribution", 1e-4)
            self.components = range(properties.get("components", 2))
            self.unlit = frozenset(properties.get("unlit", "").split())
            self.ambient = [properties.get(f"ambient_{c}", 0.0) for c in "rgb"]
            self.scene: Any = None
            self.lights: list[Any] = []
            self.points: list[Any] = []
            self.cylinders: list[Any] = []
            self.perfect: list[int] = []
            self.reach = 0.0

        def prepare(self, scene: Any) -> None:
            """Look the lights up once per scene."""
            if self.scene is not scene:
                self.scene, self.lights = scene, light_points(mi, scene, self.unlit)
                delta = mi.EmitterFlags.Delta
                self.points = [e for e in scene.emitters() if mi.has_flag(e.flags(), delta)]
                self.cylinders = [s for s in scene.shapes() if s.class_name() == "Cylinder"]
                self.perfect = [k for k in self.components if self.has_perfect(scene, k)]
                bounds = np.abs([scene.bbox().min, scene.bbox().max])
                self.reach = float(np.max(bounds[np.isfinite(bounds)], initial=0.0))

        def sample(
            self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True
        ) -> tuple[Any, Any, list[Any]]:
            """The radiance along `ray`, whether it hit anything, no further channels.

            The tree is walked depth first with all rays at once, each level masked to those that
            have it.
            """
            self.prepare(scene)
            total, valid = mi.Color3f(0.0), None
            stack = [(mi.Ray3f(ray), mi.Color3f(1.0), mi.Mask(active), 0)]
            while stack:
                ray, weight, active, depth = stack.pop()
                # Opaque: otherwise the first level, whose weight is a constant, is a kernel of its
                # own, and every level compiles again.
                dr.make_opaque(ray, weight, active)
                si = scene.ray_intersect(ray, active)
                total += weight * emitted(mi, scene, si, active)
                active &= si.is_valid()
                valid = active if valid is None else valid
                if not dr.any(active):
                    continue
                if any(self.ambient):
                    total += weight * self.ambient_light(si, active)
                smooth = active & mi.has_flag(si.bsdf().flags(), mi.BSDFFlags.Smooth)
                if dr.any(smooth):
                    total += weight * self.direct_light(scene, si, smooth)
                dr.eval(total)
                if depth < self.max_depth:
                    for component in self.perfect:
                        stack += self.branch(si, weight, active, component, depth)
            return total, valid, []

        @staticmethod
        def has_perfect(scene: Any, k: int) -> bool:
            """Whether component k of any BSDF may be a direction of its own."""
            shapes = scene.shapes()
            if any(shape.class_name() == "Instance" for shape in shapes):
                return True
            bsdfs = [bsdf for bsdf in (shape.bsdf() for shape in shapes) if bsdf is not None]
            return any(
                k < bsdf.component_count() and mi.has_flag(bsdf.flags(k), mi.BSDFFlags.Delta)
                for bsdf in bsdfs
            )

        def ambient_light(self, si: Any, active: Any) -> Any:
            """What text-book materials send of the ambient light: see `phong`."""
            context, up = mi.BSDFContext(), mi.Vector3f(0.0, 0.0, 1.0)
            context.type_mask = phong.AMBIENT
            found = si.bsdf().eval(context, si, up, active)
            context.type_mask = phong.BLANK
            rest = si.bsdf().eval(context, si, up, active)
            return dr.select(active, (found - rest) * mi.Color3f(self.ambient), 0.0)

        def branch(
            self, si: Any, weight: Any, active: Any, component: int, depth: int
        ) -> list[Any]:
            """The rays of one component that are worth following: a stack's entry, or nothing."""
            bsdf = si.bsdf()
            active = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Delta)
            if not dr.any(active):
                return []
            context = mi.BSDFContext()
            context.component = component
            # Of one component alone, if it is a direction, nothing is left to chance.
            sample, value = bsdf.sample(context, si, 0.5, mi.Point2f(0.5, 0.5), active)
            active &= mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
            weight = weight * value
            active &= dr.max(weight) > self.min_contribution
            if not dr.any(active):
                return []
            d = dr.normalize(si.to_world(sample.wo))
            ray = leave(mi, si, d, self.clearance(si))
            dr.eval(ray, weight, active)
            return [(ray, weight, active, depth + 1)]

        def clearance(self, si: Any) -> Any:
            """See there: Mitsuba's llvm variants solve a cylinder's quadratic in float32, so that
            it shades itself where rays begin any closer (measured: 247 of 16,000 pixels)."""
            rough = mi.Mask(False)
            for shape in self.cylinders:
                rough |= self.is_shape(si, shape)
            return clearance(mi, si, self.reach, rough)

        def direct_light(self, scene: Any, si: Any, active: Any) -> Any:
            """Every light that is a point or a direction, and one point of every area light."""
            total = mi.Color3f(0.0)
            context = mi.BSDFContext()
            bsdf = si.bsdf()
            height = self.clearance(si)
            for light in self.points:
                ds, radiance = light.sample_direction(si, mi.Point2f(0.5, 0.5), active)
                value = bsdf.eval(context, si, si.to_local(ds.d), active)
                ray = leave(mi, si, ds.d, height)
                if mi.has_flag(light.flags(), mi.EmitterFlags.DeltaPosition):
                    ray.maxt = ds.dist
                visible = without(active, scene.ray_test(ray, active))
                total += dr.select(visible, value * radiance, 0.0)
            for light in self.lights:
                target, solid_angle = light.seen_from(mi, dr, si.p)
                ray = leave(mi, si, dr.normalize(target - si.p), height)
                value = bsdf.eval(context, si, si.to_local(ray.d), active)
                found = scene.ray_intersect(ray, active)
                # What the ray meets is the light itself if it is as far away, as Mitsuba sees it;
                # begun off its line, the ray meets a surface seen edge-on somewhere else.
                missing = dr.norm(target - si.p) * (1.0 - mi.math.ShadowEpsilon) - found.t
                near = missing * dr.abs(dr.dot(ray.d, found.n)) <= 2.0 * height
                visible = active & found.is_valid() & near & self.is_shape(found, light.shape)
                radiance = emitted(mi, scene, found, visible)
                total += dr.select(visible, value * radiance * solid_angle, 0.0)
                dr.eval(total)
            return total

        @staticmethod
        def is_shape(found: Any, shape: Any) -> Any:
            """Whether a ray met this very shape: another may stand within the tolerance before it,
            and shine too."""
            if parameters.is_wide(mi):
                return found.shape == mi.ShapePtr(shape)
            return found.shape is shape

        def aov_names(self) -> list[str]:
            return []

        def to_string(self) -> str:
            return f"Whitted[max_depth={self.max_depth}]"

    mi.register_integrator("whitted", Whitted)
