"""Path tracing of scenes with media that have CSG solids, hidden lamps, masks or thin panes:
`{"type": "media_of_solids"}`.

Mitsuba's `volpathmis` traces Mitsuba's scene, in which there are no solids, and its shadow rays
pass masks and thin panes.  This one traces a `LitScene`, and takes all else from Mitsuba: the
camera, random numbers, BSDFs, emitters, phase functions and coefficients.

A path flies by the density of one colour, and is weighted by the mean of the densities that the
three colours have for all its flights together.  (Choosing a colour anew for each flight is as
right, but its weights multiply: in milk the variance has no end.)  Samples of lights and those of
BSDFs and phase functions are combined by the power heuristic of their densities of directions
alone, in which no flight counts: another one than that of `reference_rt.integrators.media_path`.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from comparisons.mitsuba.plugins.base import PlainScene
from comparisons.mitsuba.plugins.path_of_solids import MOST_RAYS, SURVIVAL

UNLIMITED = 0x7FFFFFFF
"""In place of a `max_depth` of -1."""


class Here(NamedTuple):
    """Where paths scatter.  at: the place;  si: its surface;  mei, medium: of those in media;
    is_inside: whether they are in media, not on surfaces."""

    at: Any
    si: Any
    mei: Any
    medium: Any
    is_inside: Any


def register(mi: Any) -> None:
    """Define the integrator for the current variant, and register it."""
    import drjit as dr

    def weight(pdf: Any, other: Any) -> Any:
        """The power heuristic's weight of a sample with this density."""
        return dr.select(pdf > 0.0, 1.0 / (1.0 + dr.square(other / pdf)), 0.0)

    def left(sigma: Any, t: Any) -> Any:
        """exp(-sigma t), for distances that may be infinite."""
        return dr.select(sigma > 0.0, dr.exp(-sigma * t), 1.0)

    def is_no_surface(si: Any, active: Any) -> Any:
        """Whether all light passes: the BSDF is `null`."""
        kinds = mi.BSDFFlags.All | mi.BSDFFlags.Null
        return active & ((si.bsdf().flags() & mi.UInt32(+kinds)) == mi.UInt32(+mi.BSDFFlags.Null))

    def beyond(si: Any, d: Any, medium: Any, active: Any) -> Any:
        """The medium behind a surface."""
        changes = active & si.is_medium_transition()
        return dr.select(changes, si.target_medium(d), medium)

    def coefficients(mei: Any, medium: Any, active: Any) -> tuple[Any, Any]:
        """sigma_s and sigma_t; 0 where there is no medium."""
        inside = active & (medium != dr.zeros(mi.MediumPtr))
        sigma_s, _, sigma_t = medium.get_scattering_coefficients(mei, inside)
        return dr.select(inside, sigma_s, 0.0), dr.select(inside, sigma_t, 0.0)

    class MediaOfSolids(mi.SamplingIntegrator):  # type: ignore[misc]
        """Parameters: max_depth, most edges of a path, -1 for no limit;  rr_depth, edges after
        which Russian roulette may end it;  hide_emitters: whether camera rays pass through area
        lights, before a black background.  `lit`, set before rendering, makes the `LitScene` of
        Mitsuba's scene; without it there are no solids."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            depth = properties.get("max_depth", -1)
            self.max_depth = UNLIMITED if depth < 0 else depth
            self.rr_depth = properties.get("rr_depth", 5)
            self.hides = properties.get("hide_emitters", False)
            self.lit: Callable[[Any], PlainScene] = partial(PlainScene, mi)
            self.most_rays = MOST_RAYS

        def sample(
            self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True
        ) -> tuple[Any, Any, list[Any]]:
            """The radiance along `ray`, whether it hit anything, no further channels.

            All paths take their next flight together: up to where they scatter, or to the next
            surface, which may be none.
            """
            lit = self.lit(scene)
            ray, active = mi.Ray3f(ray), mi.Mask(active)
            total, throughput, eta = mi.Color3f(0.0), mi.Color3f(1.0), mi.Float(1.0)
            medium = dr.zeros(mi.MediumPtr) if medium is None else mi.MediumPtr(medium)
            before, pdf, depth = dr.zeros(mi.Interaction3f), mi.Float(0.0), mi.UInt32(0)
            valid, black = mi.Mask(False), mi.Color3f(0.0)
            active &= self.max_depth > 0
            # The densities of all flights so far, in each colour, over that in the path's own.
            ratio, u_colour = mi.Color3f(1.0), sampler.next_1d(active)
            own = mi.Color3f(
                dr.select(u_colour < 1.0 / 3.0, 1.0, 0.0),
                dr.select((u_colour >= 1.0 / 3.0) & (u_colour < 2.0 / 3.0), 1.0, 0.0),
                dr.select(u_colour >= 2.0 / 3.0, 1.0, 0.0),
            )
            while dr.any(active):
                si, of_solid = lit.trace(ray, active)
                hidden = mi.Mask(self.hides) & (depth == 0)
                # A camera ray ends at the far clipping plane, also behind what is no surface.
                end = dr.minimum(si.t, ray.maxt)
                flown = self.flight(sampler, ray, end, medium, own, active)
                mei, is_inside, passed, density = flown
                throughput *= dr.select(active, passed, 1.0)
                ratio *= dr.select(active, density, 1.0)
                shared = dr.rcp(dr.mean(ratio))
                # Emission; density 0: the ray is the camera's, or of a delta lobe.
                arrives = active & ~is_inside
                competes = arrives & (pdf > 0.0) & ~of_solid
                of_light = mi.DirectionSample3f(scene, si, before)
                light_pdf = scene.pdf_emitter_direction(before, of_light, competes)
                share = dr.select(competes, weight(pdf, light_pdf), 1.0)
                emitted = throughput * shared * share * lit.emitted(si, arrives)
                total += dr.select(arrives & ~hidden, emitted, black)
                active &= is_inside | si.is_valid()
                valid |= active
                on_surface = active & ~is_inside
                passes = is_no_surface(si, on_surface)
                passes |= on_surface & hidden & si.shape.is_emitter()
                medium = beyond(si, ray.d, medium, passes)
                onward = si.spawn_ray(ray.d)
                onward.maxt = ray.maxt - si.t

                scatters = active & ~passes
                depth += dr.select(scatters, mi.UInt32(1), mi.UInt32(0))
                active &= passes | (depth < self.max_depth)
                scatters &= active
                here = Here(self.place(si, mei, is_inside), si, mei, medium, is_inside)
                on_surface = scatters & ~is_inside
                lit_by = self.next_event(lit, sampler, here, scatters)
                total += dr.select(scatters, throughput * shared * lit_by, black)

                u, uv = sampler.next_1d(active), sampler.next_2d(active)
                drawn, value = si.bsdf().sample(mi.BSDFContext(), si, u, uv, on_surface)
                turned = medium.phase_function().sample(
                    mi.PhaseFunctionContext(sampler), mei, u, uv, scatters & is_inside
                )
                d = dr.select(is_inside, turned[0], si.to_world(drawn.wo))
                throughput *= dr.select(
                    scatters, dr.select(is_inside, mi.Color3f(turned[1]), value), 1.0
                )
                eta *= dr.select(on_surface, drawn.eta, 1.0)
                is_delta = mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta)
                smooth = dr.select(is_inside, turned[2], dr.select(is_delta, 0.0, drawn.pdf))
                pdf = dr.select(scatters, smooth, pdf)
                medium = beyond(si, d, medium, on_surface)
                there = dr.select(scatters, here.at.spawn_ray(d), onward)
                ray = mi.Ray3f(there)
                for name in ("t", "p", "n"):
                    was, now = getattr(before, name), getattr(here.at, name)
                    setattr(before, name, dr.select(scatters, now, was))
                active &= dr.max(throughput) > 0.0
                ending = active & scatters & (depth >= self.rr_depth)
                survival = dr.max(throughput) * shared * dr.square(eta)
                survival = dr.minimum(survival, SURVIVAL)
                goes_on = sampler.next_1d(active) < survival
                active &= ~ending | goes_on
                throughput *= dr.select(ending, dr.rcp(survival), 1.0)
                sampler.schedule_state()
                dr.eval(
                    ray, active, total, throughput, ratio, eta, pdf, before, medium, depth, valid
                )
            return total, valid, []

        def flight(
            self, sampler: Any, ray: Any, end: Any, medium: Any, own: Any, active: Any
        ) -> tuple[Any, Any, Any, Any]:
            """Where rays scatter before the distance `end`: the interaction, whether they do, the
            factor on their light over the density of the path's own colour (1 there, else 0), and
            the densities of all over that."""
            mei = dr.zeros(mi.MediumInteraction3f, dr.width(ray))
            mei.wi, mei.sh_frame = -ray.d, mi.Frame3f(-ray.d)
            mei.time, mei.wavelengths, mei.medium = ray.time, ray.wavelengths, medium
            sigma_s, sigma_t = coefficients(mei, medium, active)
            sampled = dr.select(dr.max(sigma_s) > 0.0, sigma_t, 0.0)
            chosen = dr.sum(own * sampled)
            u = sampler.next_1d(active)
            free = dr.select(chosen > 0.0, -dr.log(1.0 - u) / chosen, dr.inf)
            inside = active & (free < end)
            t = dr.select(inside, free, end)
            density = left(sampled, t) * dr.select(inside, sampled, 1.0)
            passed = left(sigma_t, t) * dr.select(inside, sigma_s, 1.0)
            of_own = dr.sum(own * density)
            over = dr.select(of_own > 0.0, dr.rcp(of_own), 0.0)
            mei.t = dr.select(inside, t, dr.inf)
            mei.p = dr.select(inside, ray(t), 0.0)
            return mei, inside, passed * over, dr.select(of_own > 0.0, density * over, 1.0)

        def place(self, si: Any, mei: Any, is_inside: Any) -> Any:
            """Points of surfaces and of media as one interaction; those of media have no normal."""
            at = dr.zeros(mi.Interaction3f)
            at.t = dr.select(is_inside, mei.t, si.t)
            at.p = dr.select(is_inside, mei.p, si.p)
            at.n = dr.select(is_inside, mi.Normal3f(0.0), si.n)
            at.time, at.wavelengths = si.time, si.wavelengths
            return at

        def next_event(self, lit: Any, sampler: Any, here: Here, active: Any) -> Any:
            """The direct light of one sampled point on a light."""
            scene, si = lit.mi_scene, here.si
            if not scene.emitters():
                return mi.Color3f(0.0)
            bsdf = si.bsdf()
            smooth = mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
            active = active & (here.is_inside | smooth)
            drawn, radiance = scene.sample_emitter_direction(
                here.at, sampler.next_2d(active), False, active
            )
            active &= drawn.pdf > 0.0
            value, pdf = bsdf.eval_pdf(
                mi.BSDFContext(), si, si.to_local(drawn.d), active & ~here.is_inside
            )
            turned = here.medium.phase_function().eval_pdf(
                mi.PhaseFunctionContext(sampler), here.mei, drawn.d, active & here.is_inside
            )
            value = dr.select(here.is_inside, mi.Color3f(turned[0]), value)
            pdf = dr.select(here.is_inside, turned[1], pdf)
            share = dr.select(drawn.delta, 1.0, weight(drawn.pdf, pdf))
            light = dr.select(active, value * radiance * share, 0.0)
            active &= dr.max(light) > 0.0
            medium = beyond(si, drawn.d, here.medium, active & ~here.is_inside)
            distant = mi.has_flag(drawn.emitter.flags(), mi.EmitterFlags.Infinite)
            return light * self.way(lit, here.at, drawn, distant, medium, active)

        def way(self, lit: Any, at: Any, drawn: Any, distant: Any, medium: Any, active: Any) -> Any:
            """What is left of light on its way from a lamp: nothing behind a surface."""
            passed = mi.Color3f(1.0)
            going = mi.Mask(active)
            while dr.any(going):
                to_lamp, away = at.spawn_ray_to(drawn.p), at.spawn_ray(drawn.d)
                ray = dr.select(distant, away, to_lamp)
                si, _ = lit.trace(ray, going)
                met = going & si.is_valid()
                # Mitsuba's shadow rays end short of the lamp, but the medium does not.
                whole = dr.select(distant, dr.inf, dr.norm(drawn.p - ray.o))
                mei = dr.zeros(mi.MediumInteraction3f, dr.width(ray))
                _, sigma_t = coefficients(mei, medium, going)
                passed *= dr.select(going, left(sigma_t, dr.select(met, si.t, whole)), 1.0)
                open_ = is_no_surface(si, met)
                passed = dr.select(met & ~open_, 0.0, passed)
                medium = beyond(si, ray.d, medium, open_)
                at = dr.select(open_, self.place(si, mei, mi.Mask(False)), at)
                going = open_ & (dr.max(passed) > 0.0)
                dr.eval(passed, going, medium, at)
            return passed

        def aov_names(self) -> list[str]:
            return []

        def to_string(self) -> str:
            return f"MediaOfSolids[max_depth={self.max_depth}]"

    mi.register_integrator("media_of_solids", MediaOfSolids)
