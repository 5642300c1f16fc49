"""A camera with any view rectangle as a Mitsuba sensor: `{"type": "view_rectangle"}`.

Mitsuba's own cameras have square pixels, and its thin lens looks along its axis.  Counterpart of
`reference_rt.cameras.Perspective` and `ThinLens` with a `view`: rays start at the eye, or on a lens
around it, and pass a rectangle of any shape, anywhere in front of it.  Also of a `Pinhole` whose
hole has a radius.
"""

from typing import Any

import numpy as np


def register(mi: Any) -> None:
    """Define the sensor for the current variant, and register it."""

    class ViewRectangle(mi.Sensor):  # type: ignore[misc]
        """Parameters: to_world, a rigid map whose columns are left, up, forward and the eye, as of
        Mitsuba's cameras; left, right, bottom and top, the edges of the view rectangle at distance
        1; aperture_radius, 0 for none; focus_distance, to the plane in focus, below 0 for a film
        behind a hole without a lens; exposure, that radiance is weighted as irradiance of that film
        by, 0 for radiance; near_clip and far_clip, the clipping planes."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            m = np.array(properties["to_world"].matrix, np.float64)
            across, up, forward, eye = -m[:3, 0], m[:3, 1], m[:3, 2], m[:3, 3]
            l, r, b, t = (properties[name] for name in ("left", "right", "bottom", "top"))
            # Plain numbers: an array that is kept would be of the size of the first rays.
            self.eye = eye.tolist()
            self.corner = (forward + l * across + t * up).tolist()
            self.along, self.down = ((r - l) * across).tolist(), ((b - t) * up).tolist()
            self.across, self.up = across.tolist(), up.tolist()
            self.radius = properties.get("aperture_radius", 0.0)
            self.focus = properties.get("focus_distance", 1.0)
            self.exposure = properties.get("exposure", 0.0)
            self.near, self.far = properties["near_clip"], properties["far_clip"]

        def sample_ray(
            self,
            time: Any,
            wavelength_sample: Any,
            position_sample: Any,
            aperture_sample: Any,
            active: Any = True,
        ) -> tuple[Any, Any]:
            """A ray through a point of the film, from (0, 0), the upper left corner, to (1, 1)."""
            import drjit as dr

            d = mi.Vector3f(self.corner) + mi.Vector3f(self.along) * position_sample.x
            d += mi.Vector3f(self.down) * position_sample.y
            o = mi.Point3f(self.eye)
            if self.radius > 0.0:
                lens = self.radius * mi.warp.square_to_uniform_disk_concentric(aperture_sample)
                # Their x is to the left.
                shift = mi.Vector3f(self.up) * lens.y - mi.Vector3f(self.across) * lens.x
                o, d = o + shift, d - shift / self.focus
            # d ends at distance 1 along the direction of view.
            ray = mi.Ray3f(o + d * self.near, dr.normalize(d), time, mi.Color0f())
            ray.maxt = (self.far - self.near) * dr.norm(d)
            if self.exposure == 0.0:
                return ray, mi.Color3f(1.0)
            # From the film to the hole: cos^2 over the square of the way, times the hole's area;
            # d, from the film through the hole, is so many film distances long.
            area = dr.pi * self.radius**2
            return ray, mi.Color3f(self.exposure * area / (self.focus * dr.squared_norm(d)) ** 2)

        def sample_ray_differential(
            self,
            time: Any,
            wavelength_sample: Any,
            position_sample: Any,
            aperture_sample: Any,
            active: Any = True,
        ) -> tuple[Any, Any]:
            """The same; without differentials."""
            ray, weight = self.sample_ray(
                time, wavelength_sample, position_sample, aperture_sample, active
            )
            return mi.RayDifferential3f(ray), weight

        def bbox(self) -> Any:
            """Of the eye."""
            return mi.ScalarBoundingBox3f(mi.ScalarPoint3f(self.eye))

        def to_string(self) -> str:
            return "ViewRectangle[]"

    mi.register_sensor("view_rectangle", ViewRectangle)
