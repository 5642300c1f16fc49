"""Whitted's ray tracing as a Mitsuba integrator: `{"type": "whitted"}`.

Counterpart of `reference_rt.integrators.whitted`: ambient light; direct light from every point,
spot and directional light, and from one point of every area light; every mirrored, refracted and
transmitted ray; the background.  Intersections, visibility, BSDFs, Fresnel terms and emission are
Mitsuba's own.

Each component of a BSDF is sampled alone, which makes the result deterministic: delta components
are followed, the smooth components are evaluated for the lights.

Rays start closer to surfaces than in Mitsuba's integrators.  Those offset a ray by 1e-4 of the
scene's coordinates, which moves its hit by as much or more: a hundred times float32's own error,
and enough to hide a wrong direction.  Here the offset is float32's error.
"""

from typing import Any

from comparisons.mitsuba.plugins import parameters, phong
from comparisons.mitsuba.plugins.light_points import light_points
from comparisons.mitsuba.plugins.plain_scene import PlainScene

_ROUNDINGS = 8.0 * 2.0**-24
"""How far a hit point lies off its surface, over the scene's largest coordinate: the bound
`comparisons.geometry.float32.ROUNDINGS`, of which a third was measured."""


MOST_COMPONENTS = 4
"""Most components of a BSDF of Mitsuba that has no others nested in it: of `principled`."""


def clearance(mi: Any, si: Any, reach: float, cylinders: list[Any]) -> Any:
    """How far off its surface a ray starts: at most Mitsuba's own ray epsilon, and as much on the
    scene's cylinders;  reach: the scene's largest coordinate.

    Mitsuba's llvm variants solve the quadratic of cylinders in float32, so that closer rays hit the
    cylinder itself again (measured: 247 of 16,000 pixels).
    """
    import drjit as dr

    rough = mi.Mask(False)
    for shape in cylinders:
        rough |= is_shape(mi, si, shape)
    own = (1.0 + dr.max(dr.abs(si.p))) * mi.math.RayEpsilon
    return dr.select(rough, own, dr.minimum(own, _ROUNDINGS * reach))


def is_shape(mi: Any, found: Any, shape: Any) -> Any:
    """Whether the surface interaction `found` is on this very shape: another emitter may lie within
    the tolerance in front of a light."""
    if parameters.is_wide(mi):
        return found.shape == mi.ShapePtr(shape)
    return found.shape is shape


def leave(mi: Any, si: Any, d: Any, height: Any) -> Any:
    """A ray from a surface along the unit `d`, started at `height` above it.

    The origin moves along `d`, which keeps the ray on its line, but at most ten heights: at grazing
    angles it would skip nearby geometry.  The rest of the height is along the normal.
    """
    import drjit as dr

    cosine = dr.dot(d, si.n)
    along = height / dr.maximum(dr.abs(cosine), 0.1)
    rest = dr.copysign(height, cosine) - along * cosine
    return mi.Ray3f(si.p + d * along + si.n * rest, d, si.time, si.wavelengths)


def without(mask: Any, other: Any) -> Any:
    """mask and not other; `~` would turn the plain bools of scalar variants into integers."""
    import drjit as dr

    return dr.select(other, False, mask)


def register(mi: Any) -> None:
    """Define the integrator for the current variant, and register it."""
    import drjit as dr

    class Whitted(mi.SamplingIntegrator):  # type: ignore[misc]
        """Parameters: max_depth, most reflections and refractions of a ray; min_contribution, the
        throughput below which a ray is not followed; components, at least as many as any BSDF has;
        unlit, the ids, separated by spaces, of emissive shapes that do not count as lights;
        boxes, those of boxes;
        ambient_r, ambient_g, ambient_b, the ambient light's radiance."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.max_depth = properties.get("max_depth", 8)
            self.min_contribution = properties.get("min_contribution", 1e-4)
            self.components = range(properties.get("components", 2))
            self.unlit, self.boxes = (
                frozenset(properties.get(name, "").split()) for name in ("unlit", "boxes")
            )
            self.ambient = [properties.get(f"ambient_{c}", 0.0) for c in "rgb"]
            self.scene: Any = None
            self.lights: list[Any] = []
            self.points: list[Any] = []
            self.cylinders: list[Any] = []
            self.perfect: list[int] = []
            self.reach = 0.0
            self.scalar = not parameters.is_wide(mi)

        def render(self, scene: Any, *args: Any, **kwargs: Any) -> Any:
            """Mitsuba's own; the scene, which has the integrator, is forgotten at the end."""
            try:
                return super().render(scene, *args, **kwargs)
            finally:
                self.scene = None

        def prepare(self, scene: PlainScene) -> None:
            """Collect the lights, once per scene."""
            if self.scene is not scene.mi_scene:
                self.scene = scene.mi_scene
                self.lights = light_points(mi, scene, self.unlit, self.boxes)
                delta = mi.EmitterFlags.Delta
                self.points = [e for e in scene.emitters() if mi.has_flag(e.flags(), delta)]
                self.cylinders = scene.cylinders()
                self.perfect = [k for k in self.components if self.has_perfect(scene, k)]
                self.reach = scene.reach()

        def sample(
            self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True
        ) -> tuple[Any, Any, list[Any]]:
            """The radiance along `ray`, whether it hit anything, no further channels; `scene` is
            Mitsuba's, or a `LitScene`.

            The ray tree is traversed depth first with all rays at once, masked to those that have
            the branch.
            """
            scene = PlainScene(mi, scene) if isinstance(scene, mi.Scene) else scene
            self.prepare(scene)
            total, valid = mi.Color3f(0.0), None
            stack = [(mi.Ray3f(ray), mi.Color3f(1.0), mi.Mask(active), 0)]
            while stack:
                ray, weight, active, depth = stack.pop()
                # Opaque: otherwise the constant weight of the first level makes another kernel, and
                # every level compiles again.
                dr.make_opaque(ray, weight, active)
                si = scene.ray_intersect(ray, active)
                total += weight * scene.emitted(si, active)
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
            """Whether component k of any BSDF may be a delta component."""
            shapes = scene.shapes()
            if any(shape.class_name() == "Instance" for shape in shapes):
                return True
            bsdfs = [bsdf for bsdf in (shape.bsdf() for shape in shapes) if bsdf is not None]
            return any(
                k < bsdf.component_count() and mi.has_flag(bsdf.flags(k), mi.BSDFFlags.Delta)
                for bsdf in bsdfs
            )

        def ambient_light(self, si: Any, active: Any) -> Any:
            """The ambient light that Phong materials reflect: see `phong`."""
            context, up = mi.BSDFContext(), mi.Vector3f(0.0, 0.0, 1.0)
            context.type_mask = phong.AMBIENT
            found = si.bsdf().eval(context, si, up, active)
            context.type_mask = phong.BLANK
            rest = si.bsdf().eval(context, si, up, active)
            return dr.select(active, (found - rest) * mi.Color3f(self.ambient), 0.0)

        def branch(
            self, si: Any, weight: Any, active: Any, component: int, depth: int
        ) -> list[Any]:
            """The rays of one delta component with enough throughput: one stack entry, or none."""
            bsdf = si.bsdf()
            active = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Delta)
            if not dr.any(active):
                return []
            context = mi.BSDFContext()
            context.component = component
            # A single delta component is sampled deterministically.
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
            return clearance(mi, si, self.reach, self.cylinders)

        def direct_light(self, scene: Any, si: Any, active: Any) -> Any:
            """Light from every point, spot and directional light, and from one point of every area
            light."""
            total = mi.Color3f(0.0)
            context = mi.BSDFContext()
            bsdf = si.bsdf()
            height = self.clearance(si)
            for light in self.points:
                ds, radiance = light.sample_direction(si, mi.Point2f(0.5, 0.5), active)
                value = bsdf.eval(context, si, si.to_local(ds.d), active)
                ray = leave(mi, si, ds.d, height)
                if mi.has_flag(light.flags(), mi.EmitterFlags.DeltaPosition):
                    # It ends before a surface on which the light lies: as far as it may have moved
                    # along at its start.
                    ray.maxt = dr.maximum(dr.dot(ds.p - ray.o, ray.d) - 10.0 * height, 0.0)
                visible = without(active, scene.ray_test(ray, active))
                total += dr.select(visible, value * radiance, 0.0)
            for light in self.lights:
                target, solid_angle = light.seen_from(mi, dr, si.p)
                ray = leave(mi, si, dr.normalize(target - si.p), height)
                value = bsdf.eval(context, si, si.to_local(ray.d), active)
                if self.scalar and dr.all(value * solid_angle == 0.0):
                    continue  # a mesh may have hundreds of lights, of which half face away
                found = scene.ray_intersect(ray, active)
                # The ray sees the light if it hits it at the right distance.  The ray starts off
                # its line, so the tolerance is taken along the light's normal.  Another triangle of
                # a mesh may hide this one within Mitsuba's shadow epsilon.
                slack = 0.0 if light.of_mesh else mi.math.ShadowEpsilon
                missing = dr.dot(target - ray.o, ray.d) * (1.0 - slack) - found.t
                near = missing * dr.abs(dr.dot(ray.d, found.n)) <= 2.0 * height
                visible = active & found.is_valid() & near & is_shape(mi, found, light.shape)
                radiance = scene.emitted(found, visible)
                total += dr.select(visible, value * radiance * solid_angle, 0.0)
                dr.eval(total)
            return total

        def aov_names(self) -> list[str]:
            return []

        def to_string(self) -> str:
            return f"Whitted[max_depth={self.max_depth}]"

    mi.register_integrator("whitted", Whitted)
