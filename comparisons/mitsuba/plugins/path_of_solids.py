"""Path tracing and direct illumination of scenes with CSG solids or hidden lamps, and path tracing
of those with masks: `{"type": "path_of_solids"}`.

Mitsuba's own integrators trace Mitsuba's scene, in which there are no solids, and are wrong for
masks and behind hidden lamps (`squares_opacity` and `misplaces` in
`comparisons.translator.mistakes`).  This one traces a `LitScene`, and takes all else from
Mitsuba: the camera, the film, random numbers, BSDFs and emitters.  The estimator is the textbook's:
at each surface one sample of a light and one of the BSDF, combined with the power heuristic (Veach
1997).  Its mean is that of Mitsuba's `path` and `direct`.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from comparisons.mitsuba.plugins.base import PlainScene
from comparisons.mitsuba.plugins.whitted import clearance, leave

MOST_RAYS = 1 << 20
"""Rays that are traced together: each takes a kilobyte in wide variants."""

SURVIVAL = 0.95
"""The highest survival probability of Russian roulette."""


def register(mi: Any) -> None:
    """Define the integrator for the current variant, and register it."""
    import drjit as dr

    def weight(pdf: Any, other: Any) -> Any:
        """The power heuristic's weight of a sample with this density."""
        return dr.select(pdf > 0.0, 1.0 / (1.0 + dr.square(other / pdf)), 0.0)

    class PathOfSolids(mi.SamplingIntegrator):  # type: ignore[misc]
        """Parameters: max_depth, most edges of a path, -1 for no limit;  rr_depth, edges after
        which Russian roulette may end it;  samples_lights, samples_bsdfs: whether direct light is
        sampled in this way;  hide_emitters: whether camera rays pass through area lights, before
        a black background;  starts_close: whether rays start at float32's error off surfaces, in
        place of Mitsuba's ray epsilon.  `lit`, set before rendering, makes the `LitScene` of
        Mitsuba's scene; without it there are no solids."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.max_depth = properties.get("max_depth", -1)
            self.rr_depth = properties.get("rr_depth", 5)
            self.samples_lights = properties.get("samples_lights", True)
            self.samples_bsdfs = properties.get("samples_bsdfs", True)
            self.hides = properties.get("hide_emitters", False)
            self.close = properties.get("starts_close", False)
            self.lit: Callable[[Any], PlainScene] = partial(PlainScene, mi)
            self.most_rays = MOST_RAYS
            self.height: Callable[[Any], Any] = lambda si: 0.0

        def sample(
            self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True
        ) -> tuple[Any, Any, list[Any]]:
            """The radiance along `ray`, whether it hit anything, no further channels.

            All paths take their next edge together.
            """
            lit = self.lit(scene)
            if self.close:
                self.height = partial(clearance, mi, reach=lit.reach(), has_planes=bool(lit.planes))
            ray, active = mi.Ray3f(ray), mi.Mask(active)
            total, throughput, eta = mi.Color3f(0.0), mi.Color3f(1.0), mi.Float(1.0)
            before, bsdf_pdf, valid = dr.zeros(mi.Interaction3f), mi.Float(0.0), None
            depth = 0
            if self.hides:
                ray = self.behind_lamps(lit, ray, active)
            while depth != self.max_depth and dr.any(active):
                si, of_solid = lit.trace(ray, active)
                # Density 0: the ray is the camera's or of a delta lobe, and has no competitor.
                light_pdf = mi.Float(0.0)
                sampled = mi.DirectionSample3f(scene, si, before)
                if depth > 0 and self.samples_lights:
                    competes = active & (bsdf_pdf > 0.0) & (of_solid ^ True)
                    light_pdf = scene.pdf_emitter_direction(before, sampled, competes)
                    light_pdf = dr.select(competes, light_pdf, 0.0)
                share = dr.select(bsdf_pdf > 0.0, weight(bsdf_pdf, light_pdf), 1.0)
                if depth > 0 or not self.hides:
                    total += throughput * share * lit.emitted(si, active)
                active &= si.is_valid()
                valid = active if valid is None else valid
                depth += 1
                if depth == self.max_depth:
                    break
                bsdf, context = si.bsdf(), mi.BSDFContext()
                if self.samples_lights:
                    total += throughput * self.next_event(lit, sampler, si, active)
                if not self.samples_bsdfs:
                    break
                drawn, value = bsdf.sample(
                    context, si, sampler.next_1d(active), sampler.next_2d(active), active
                )
                throughput *= value
                eta *= drawn.eta
                is_delta = mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta)
                bsdf_pdf = dr.select(is_delta, 0.0, drawn.pdf)
                ray = self.onward(si, si.to_world(drawn.wo))
                before = dr.zeros(mi.Interaction3f)
                before.t, before.p, before.n = si.t, si.p, si.n
                active &= dr.max(throughput) > 0.0
                if depth >= self.rr_depth:
                    survival = dr.minimum(dr.max(throughput) * dr.square(eta), SURVIVAL)
                    active &= sampler.next_1d(active) < survival
                    throughput *= dr.select(active, 1.0 / survival, 0.0)
                sampler.schedule_state()
                dr.eval(ray, active, total, throughput, eta, bsdf_pdf, before)
            return total, valid if valid is not None else active, []

        def onward(self, si: Any, d: Any) -> Any:
            """A ray from a surface along the unit direction d."""
            if not self.close:
                return si.spawn_ray(d)
            return leave(mi, si, dr.normalize(d), self.height(si))

        def onward_to(self, si: Any, drawn: Any) -> Any:
            """A ray from a surface to a point on a light."""
            if not self.close:
                return si.spawn_ray_to(drawn.p)
            ray = self.onward(si, drawn.d)
            ray.maxt = dr.dot(drawn.p - ray.o, ray.d) * (1.0 - mi.math.ShadowEpsilon)
            return ray

        def behind_lamps(self, lit: Any, ray: Any, active: Any) -> Any:
            """The rest of each ray behind the area lights that it meets first."""
            going = mi.Mask(active)
            while dr.any(going):
                si, _ = lit.trace(ray, going)
                going &= si.is_valid() & si.shape.is_emitter()
                onward = si.spawn_ray(ray.d)
                onward.maxt = ray.maxt - si.t
                ray = dr.select(going, onward, ray)
                dr.eval(ray, going)
            return ray

        def next_event(self, lit: Any, sampler: Any, si: Any, active: Any) -> Any:
            """The direct light of one sampled point on a light."""
            scene = lit.mi_scene
            bsdf, context = si.bsdf(), mi.BSDFContext()
            if not scene.emitters():
                return mi.Color3f(0.0)
            active = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
            drawn, radiance = scene.sample_emitter_direction(
                si, sampler.next_2d(active), False, active
            )
            active &= drawn.pdf > 0.0
            wo = si.to_local(drawn.d)
            value, bsdf_pdf = bsdf.eval_pdf(context, si, wo, active)
            share = dr.select(drawn.delta, 1.0, weight(drawn.pdf, bsdf_pdf))
            if not self.samples_bsdfs:
                share = 1.0
            light = dr.select(active, value * radiance * share, 0.0)
            active &= dr.max(light) > 0.0
            # Mitsuba's rays to distant lights end beyond its own scene, which lacks the solids.
            distant = mi.has_flag(drawn.emitter.flags(), mi.EmitterFlags.Infinite)
            shadow = self.onward_to(si, drawn)
            away = self.onward(si, drawn.d)
            shadow = dr.select(distant, away, shadow)
            return dr.select(lit.ray_test(shadow, active), 0.0, light)

        def aov_names(self) -> list[str]:
            return []

        def to_string(self) -> str:
            return f"PathOfSolids[max_depth={self.max_depth}]"

    mi.register_integrator("path_of_solids", PathOfSolids)
