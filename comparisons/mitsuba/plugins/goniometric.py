"""A lamp with a measured table of intensities as a Mitsuba emitter: `{"type": "goniometric"}`.

Mitsuba has none.  Counterpart of `reference_rt.lights.Goniometric`, with another way from a
direction to the table: the table stays as it is given, and a horizontal angle is folded to where
the table has it, by the lamp's planes of symmetry.
"""

from bisect import bisect_right
from typing import Any

import numpy as np

from comparisons.mitsuba.plugins.base import is_wide


def register(mi: Any) -> None:
    """Define the emitter for the current variant, and register it."""
    import drjit as dr

    class Goniometric(mi.Emitter):  # type: ignore[misc]
        """Parameters: to_world, a map whose third column is the axis, towards the vertical angle 0,
        whose second one points to the horizontal angle 0, and whose last one is the place;
        vertical_angles and horizontal_angles in degrees, and values, one row for each horizontal
        angle: numbers in a text;  intensity: a factor of the values."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            m = np.array(properties["to_world"].matrix, np.float64)
            self.place = m[:3, 3].tolist()
            down = m[:3, 2] / np.linalg.norm(m[:3, 2])
            c0 = m[:3, 1] - down * (down @ m[:3, 1])
            c0 = c0 / np.linalg.norm(c0)
            # Counterclockwise for who looks along the axis.
            self.axes = [c0.tolist(), np.cross(c0, down).tolist(), down.tolist()]
            self.vertical, self.horizontal, self.values = (
                np.array(properties[name].split(), np.float64).tolist()
                for name in ("vertical_angles", "horizontal_angles", "values")
            )
            self.intensity = [float(c) for c in np.ravel(properties["intensity"])] * (
                1 if np.size(properties["intensity"]) == 3 else 3
            )
            self.m_flags = mi.EmitterFlags.DeltaPosition

        def folded(self, c: Any) -> Any:
            """A horizontal angle from 0 to 360 as the one in the table with the same values."""
            first, last = self.horizontal[0], self.horizontal[-1]
            if len(self.horizontal) == 1:
                return 0.0 * c
            if last == 90.0:
                c = dr.minimum(c, 360.0 - c)
                return dr.minimum(c, 180.0 - c)
            if last == 180.0:
                return dr.minimum(c, 360.0 - c)
            if first == 90.0:
                c = dr.select(c < 90.0, 180.0 - c, c)
                return dr.select(c > 270.0, 540.0 - c, c)
            return c

        def look_up(self, gamma: Any, c: Any, active: Any) -> Any:
            """The table between its angles, bilinear; 0 beyond its vertical ones."""
            m, k = len(self.vertical), len(self.horizontal)
            j, t = self.between(self.vertical, gamma)
            i, s = self.between(self.horizontal, self.folded(c)) if k > 1 else (0, 0.0)
            value = 0.0
            for di, weight_c in ((0, 1.0 - s), (1, s)) if k > 1 else ((0, 1.0),):
                for dj, weight_v in ((0, 1.0 - t), (1, t)):
                    value += weight_c * weight_v * self.at((i + di) * m + j + dj, active)
            inside = (gamma >= self.vertical[0]) & (gamma <= self.vertical[-1])
            return dr.select(inside, value, 0.0)

        def between(self, angles: Any, x: Any) -> tuple[Any, Any]:
            """The number of the last angle not above x, none but the last one, and how far x is
            towards the next."""
            n = len(angles)
            if not is_wide(mi):
                j = min(max(bisect_right(angles, x) - 1, 0), n - 2)
                return j, (x - angles[j]) / (angles[j + 1] - angles[j])
            column = mi.Float64(angles)
            search: Any = dr.binary_search
            after = search(0, n, lambda k: dr.gather(mi.Float64, column, k) <= x)
            j = mi.UInt32(dr.clip(mi.Int32(after) - 1, 0, n - 2))
            low, high = dr.gather(mi.Float64, column, j), dr.gather(mi.Float64, column, j + 1)
            return j, (x - low) / (high - low)

        def at(self, k: Any, active: Any) -> Any:
            if not is_wide(mi):
                return self.values[k]
            return dr.gather(mi.Float64, mi.Float64(self.values), k, active)

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            ds = mi.DirectionSample3f()
            ds.p = mi.Point3f(self.place)
            ds.n = mi.Normal3f(0.0)
            ds.uv = mi.Point2f(0.0)
            ds.time = it.time
            ds.pdf = 1.0
            ds.delta = mi.Mask(True)
            ds.emitter = mi.EmitterPtr(self) if is_wide(mi) else self
            ds.d = ds.p - it.p
            ds.dist = dr.norm(ds.d)
            ds.d /= ds.dist
            number = mi.Float64
            w = [number(one) - place for one, place in zip(it.p, self.place, strict=True)]
            x, y, z = (w[0] * axis[0] + w[1] * axis[1] + w[2] * axis[2] for axis in self.axes)
            gamma = dr.rad2deg(dr.atan2(dr.sqrt(x * x + y * y), z))
            c = dr.rad2deg(dr.atan2(y, x))
            c = dr.select(c < 0.0, c + 360.0, c)
            value = mi.Float(self.look_up(gamma, c, active)) / (ds.dist * ds.dist)
            spectrum = mi.Color3f(self.intensity) * value
            return ds, spectrum & active if is_wide(mi) else spectrum

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return mi.Float(0.0)

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return mi.Color3f(0.0)

        def eval(self, si: Any, active: Any = True) -> Any:
            return mi.Color3f(0.0)

        def bbox(self) -> Any:
            return mi.ScalarBoundingBox3f(mi.ScalarPoint3f(self.place))

        def to_string(self) -> str:
            return f"Goniometric[place={self.place}]"

    mi.register_emitter("goniometric", Goniometric)
