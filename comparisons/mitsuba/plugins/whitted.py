"""Whitted's ray tracing as a Mitsuba integrator: `{"type": "whitted"}`.

Counterpart of `reference_rt.integrators.whitted`: ambient light; direct light from every point,
spot and directional light, and from one point of every area light; every mirrored, refracted and
transmitted ray; the background.  Intersections, visibility, BSDFs, Fresnel terms and emission are
Mitsuba's own.

Each component of a BSDF is sampled alone, which makes the result deterministic: delta components
are followed, the smooth components are evaluated for the lights.

Rays start closer to surfaces than in Mitsuba's integrators.  Those offset a ray by 1e-4 of the
scene's coordinates, which moves its hit by as much or more: a hundred times float32's own error,
and enough to hide a wrong direction.  Here the offset is float32's error."""

import math
from collections.abc import Callable, Collection
from typing import Any, NamedTuple

import numpy as np

from comparisons.mitsuba.plugins import base, materials
from comparisons.mitsuba.plugins.base import PlainScene
from reference_rt.core.arrays import FloatArray

# ---- the one point that represents each area light -----------------------------------------------
# The choice of the points is a convention, the same as in `reference_rt`: u0 = u1 = 1/2 in each
# shape's own sampling. Size, position and orientation are read from Mitsuba's own shapes, in
# float64.


_SMALLEST = float(np.finfo(np.float32).tiny)


class FixedPoint(NamedTuple):
    """A primitive that is represented by its point p, with unit normal n and an area: (3,), (3,),
    1; shape is Mitsuba's object;  of_mesh: whether it is one of a mesh's triangles.  The emitter
    determines which side shines."""

    p: Any
    n: Any
    area: Any
    shape: Any
    of_mesh: bool = False

    def seen_from(self, mi: Any, dr: Any, p: Any) -> tuple[Any, Any]:
        """The point, and the solid angle that it represents: area cos / distance²."""
        w = p - self.p
        distance2 = dr.squared_norm(w)
        # From the point itself the solid angle is 0: 0 over the smallest float.
        distance3 = dr.maximum(distance2 * dr.sqrt(distance2), _SMALLEST)
        return self.p, self.area * dr.abs(dr.dot(w, self.n)) / distance3


class SphereLight(NamedTuple):
    """A sphere, whose point depends on where it is seen from."""

    center: Any
    radius: Any
    shape: Any
    of_mesh: bool = False

    def seen_from(self, mi: Any, dr: Any, p: Any) -> tuple[Any, Any]:
        """The point at the mean cosine of the subtended cone, and the cone's solid angle.

        1 - cos = (1 - cos theta_max) / 2 and phi = pi, in the basis of Duff et al. (2017), which
        Mitsuba uses too.  0 from inside and from the surface, where rounding would decide: points
        closer than Mitsuba's ray epsilon count as on the surface.
        """
        to_center = self.center - p
        distance2 = dr.squared_norm(to_center)
        distance = dr.sqrt(distance2)
        r2 = self.radius * self.radius
        outside = distance - self.radius > (1.0 + dr.max(dr.abs(p))) * mi.math.RayEpsilon
        sin2_max = dr.select(outside, r2 / distance2, 0.0)
        one_minus_cos_max = sin2_max / (1.0 + dr.sqrt(1.0 - sin2_max))
        one_minus_cos = 0.5 * one_minus_cos_max
        cos = 1.0 - one_minus_cos
        sin2 = one_minus_cos * (1.0 + cos)
        frame = mi.Frame3f(mi.Normal3f(to_center / distance))
        d = frame.to_world(mi.Vector3f(-dr.sqrt(sin2), 0.0, cos))
        along = distance * cos - dr.sqrt(dr.maximum(0.0, r2 - distance2 * sin2))
        solid_angle = dr.select(outside, 2.0 * math.pi * one_minus_cos_max, 0.0)
        return p + d * along, solid_angle


class BoxPoint(NamedTuple):
    """The point of a box, on one of its faces.  From behind that face its solid angle is 0: a ray
    towards it would hit another face, near an edge within the tolerance of the right distance."""

    face: FixedPoint
    of_mesh: bool = False

    @property
    def shape(self) -> Any:
        return self.face.shape

    def seen_from(self, mi: Any, dr: Any, p: Any) -> tuple[Any, Any]:
        """As `FixedPoint.seen_from`, 0 from behind the face."""
        point, solid_angle = self.face.seen_from(mi, dr, p)
        return point, dr.select(dr.dot(p - self.face.p, self.face.n) > 0.0, solid_angle, 0.0)


LightPoint = FixedPoint | BoxPoint | SphereLight


def light_points(
    mi: Any, scene: Any, unlit: Collection[str] = (), boxes: Collection[str] = ()
) -> list[LightPoint]:
    """The points of all area lights of a scene, except shapes whose id is in `unlit`;  boxes: the
    ids of boxes and rectangles, which may be meshes: see `comparisons.shapes`."""
    points: list[LightPoint] = []
    for emitter in scene.emitters():
        shape = emitter.get_shape()
        if shape is not None and shape.id() not in unlit:
            points += _points_of(mi, shape, shape.id() in boxes)
    return points


_FLAT = {"Rectangle": 4.0, "Disk": math.pi}
"""Untransformed areas of the plugins whose point is their centre."""


def _points_of(mi: Any, shape: Any, is_box: bool) -> list[LightPoint]:
    kind = shape.class_name()
    if kind == "Sphere":
        m = _to_world(mi, shape)
        return [
            SphereLight(
                mi.Point3f(m[:3, 3].tolist()), mi.Float(float(np.linalg.norm(m[:3, 0]))), shape
            )
        ]
    if kind in _FLAT:
        m = _to_world(mi, shape)
        return [_fixed(mi, shape, m[:3, 3], _FLAT[kind] * np.cross(m[:3, 0], m[:3, 1]))]
    values = mi.traverse(shape)
    vertices = np.array(values["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    if kind == "Cube" or (is_box and len(vertices) > 4):
        return [_box_point(mi, shape, vertices, *(_CUBE if kind == "Cube" else _MESH))]
    corners = vertices[np.array(values["faces"]).reshape(-1, 3)]
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if is_box:  # a rectangle
        return [_fixed(mi, shape, vertices.mean(axis=0), areas.sum(axis=0))]
    # Turk's square root warp: barycentrics sqrt(1/2) / 2 of the second and the third corner.
    b = 0.5 * math.sqrt(0.5)
    points = corners[:, 0] * (1.0 - 2.0 * b) + (corners[:, 1] + corners[:, 2]) * b
    sized = np.flatnonzero(np.linalg.norm(areas, axis=1) > 0.0).tolist()
    return [_fixed(mi, shape, points[k], areas[k])._replace(of_mesh=True) for k in sized]


def _to_world(mi: Any, shape: Any) -> FloatArray:
    matrix = mi.traverse(shape)["to_world"].matrix
    return np.array(matrix, dtype=np.float64).reshape(4, 4)


def _fixed(mi: Any, shape: Any, p: FloatArray, area: FloatArray) -> FixedPoint:
    """`area` (3,): the normal, as long as the area."""
    size = float(np.linalg.norm(area))
    return FixedPoint(
        mi.Point3f(p.tolist()), mi.Vector3f((area / size).tolist()), mi.Float(size), shape
    )


def _box_point(
    mi: Any, shape: Any, vertices: FloatArray, front: list[int], back: list[int]
) -> "BoxPoint":
    """The point at half of the cumulative area of the faces -x +x -y +y -z +z, starting half of the
    first face before the list."""
    center = vertices.mean(axis=0)
    middle = vertices.reshape(6, 4, 3).mean(axis=1)
    edges = 0.5 * (middle[front] - middle[back])
    normals = np.cross(edges[[1, 2, 0]], edges[[2, 0, 1]])
    normals *= np.sign(np.linalg.det(edges))  # outwards, also where a map mirrors
    face_areas = 4.0 * np.linalg.norm(normals, axis=1)
    rest = float(face_areas.sum()) - 0.5 * float(face_areas[0])
    axis = 0
    while axis < 2 and rest >= 2.0 * face_areas[axis]:
        rest -= 2.0 * float(face_areas[axis])
        axis += 1
    rest /= float(face_areas[axis])
    sign = -1.0
    if rest >= 1.0:
        rest, sign = rest - 1.0, 1.0
    first = edges[1 if axis == 0 else 0]
    p = center + edges[axis] * sign + first * (2.0 * min(rest, 1.0) - 1.0)
    n = normals[axis] / np.linalg.norm(normals[axis])
    return BoxPoint(_fixed(mi, shape, p, n * sign * 2.0 * float(face_areas.sum())))


_CUBE, _MESH = ([2, 1, 3], [4, 0, 5]), ([3, 4, 5], [0, 1, 2])
"""The faces +x +y +z and -x -y -z among the groups of four vertices: of Mitsuba's cubes
(src/shapes/cube.cpp), and of our meshes."""


# ---- the integrator ------------------------------------------------------------------------------


_ROUNDINGS = 8.0 * 2.0**-24
"""How far a hit point lies off its surface, over the scene's largest coordinate: the bound
`comparisons.geometry.frame.ROUNDINGS`, of which a third was measured."""


MOST_COMPONENTS = 4
"""Most components of a BSDF of Mitsuba that has no others nested in it: of `principled`."""


def reach_of_planes(size: Any) -> Any:
    """The largest coordinate of the triangle of an infinite plane's mesh whose point has `size` as
    its largest coordinate: see `comparisons.shapes.plane`.

    A ring's corners are at most 2 / cos(pi / 16) times as far from the plane's point nearest to the
    origin, m, as points between it and the ring before: |m| + 2.04 r <= 2.27 |m + r|, which is
    3.93 times the largest component.  The first ring is 2^-14 of |m| wide, or of 1.
    """
    return 4.0 * (size + 2.0**-14)


def clearance(mi: Any, si: Any, reach: float, has_planes: bool) -> Any:
    """How far off its surface a ray starts: at most Mitsuba's own ray epsilon, and as much on
    cylinders and on spheres in instances;  reach: the largest coordinate on a shape that is finite;
    has_planes: whether there are others.

    Mitsuba's llvm variants solve the quadratics of cylinders in float32, and those of spheres with
    an error where an instance flattens them, so that closer rays hit the shape itself again
    (measured: 247 of 16,000 pixels of a cylinder, 178 of 1,536 of a sphere that is 0.3 as high as
    it is wide), as they do in scalar variants where an instance flattens a cylinder.
    """
    import drjit as dr

    size = dr.max(dr.abs(si.p))
    own = (1.0 + size) * mi.math.RayEpsilon
    near = _ROUNDINGS * (dr.maximum(reach, reach_of_planes(size)) if has_planes else reach)
    return dr.select(is_rough(mi, si), own, dr.minimum(own, near))


def is_rough(mi: Any, si: Any) -> Any:
    """Whether the surface interaction is on a shape of which Mitsuba solves a quadratic with an
    error."""
    if base.is_wide(mi):
        kind, is_in_instance = si.shape.shape_type(), si.instance != mi.ShapePtr(None)
        is_flattened = is_in_instance & (kind == int(mi.ShapeType.Sphere))
        return (kind == int(mi.ShapeType.Cylinder)) | is_flattened
    return si.shape is not None and si.shape.shape_type() == mi.ShapeType.Cylinder


def is_shape(mi: Any, si: Any, shape: Any) -> Any:
    """Whether the surface interaction `found` is on this very shape: another emitter may lie within
    the tolerance in front of a light."""
    if base.is_wide(mi):
        return si.shape == mi.ShapePtr(shape)
    return si.shape is shape


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
        boxes, those of boxes and rectangles;
        ambient_r, ambient_g, ambient_b, the ambient light's radiance.

        met: called with each ray of the tree that is traced, its weight, the mask of the rays that
        have it, and the number of surfaces before it."""

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
            self.has_planes = False
            self.perfect: list[int] = []
            self.reach = 0.0
            self.scalar = not base.is_wide(mi)
            self.met: Callable[..., None] | None = None

        def render(self, scene: Any, *args: Any, **kwargs: Any) -> Any:
            """Mitsuba's own; the scene, which has the integrator, is forgotten at the end."""
            try:
                return super().render(scene, *args, **kwargs)
            finally:
                self.scene = None

        def prepare(self, scene: PlainScene) -> None:
            """Collect the lights, once per scene.  Scalar variants may come here in several
            threads at once: the scene is what says that all is there, and comes last."""
            if self.scene is not scene.mi_scene:
                self.lights = light_points(mi, scene, self.unlit, self.boxes)
                delta = mi.EmitterFlags.Delta
                self.points = [e for e in scene.emitters() if mi.has_flag(e.flags(), delta)]
                self.has_planes = bool(scene.planes)
                self.perfect = [k for k in self.components if self.has_perfect(scene, k)]
                self.reach = scene.reach()
                self.scene = scene.mi_scene

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
                if self.met is not None:
                    self.met(ray, weight, active, depth)
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
            """The ambient light that Phong materials reflect: see `materials`."""
            context, up = mi.BSDFContext(), mi.Vector3f(0.0, 0.0, 1.0)
            context.type_mask = materials.AMBIENT
            reflected = si.bsdf().eval(context, si, up, active)
            context.type_mask = materials.BLANK
            rest = si.bsdf().eval(context, si, up, active)
            return dr.select(active, (reflected - rest) * mi.Color3f(self.ambient), 0.0)

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
            return clearance(mi, si, self.reach, self.has_planes)

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
                met = scene.ray_intersect(ray, active)
                # The ray sees the light if it hits it at the right distance.  The ray starts off
                # its line, so the tolerance is taken along the light's normal.  Another triangle of
                # a mesh may hide this one within Mitsuba's shadow epsilon.
                slack = 0.0 if light.of_mesh else mi.math.ShadowEpsilon
                missing = dr.dot(target - ray.o, ray.d) * (1.0 - slack) - met.t
                near = missing * dr.abs(dr.dot(ray.d, met.n)) <= 2.0 * height
                visible = active & met.is_valid() & near & is_shape(mi, met, light.shape)
                radiance = scene.emitted(met, visible)
                total += dr.select(visible, value * radiance * solid_angle, 0.0)
                dr.eval(total)
            return total

        def aov_names(self) -> list[str]:
            return []

        def to_string(self) -> str:
            return f"Whitted[max_depth={self.max_depth}]"

    mi.register_integrator("whitted", Whitted)
