"""Compiled loops over many inputs, for kernels that have no query of their own."""

import math

import numpy as np

from reference_rt import shapes as any_shape
from reference_rt.kernel import entry_kernel
from reference_rt.ray import Ray, no_hit, ray_from
from reference_rt.shapes.shape import FloatArray
from reference_rt.shapes.triangle import shear_of
from reference_rt.vec3 import row


class Probe:
    """What `probe` finds for n rays; t and again are inf for a miss."""

    def __init__(self, out: FloatArray) -> None:
        self.t, self.again, self.error = out[:, 0], out[:, 1], out[:, 2]
        self.p, self.n = out[:, 3:6], out[:, 6:9]
        self.start = out[:, 9:12]
        self.u, self.v, self.face = out[:, 12], out[:, 13], out[:, 14]


@entry_kernel
def _probe(shapes, kind, rows, o, d, w, out):
    for i in range(len(o)):
        ray = Ray(row(o, i), row(d, i), math.inf)
        hit = any_shape.intersect(shapes, kind, rows[i], ray, shear_of(ray), no_hit(ray))
        out[i, 0] = hit.t
        out[i, 1] = math.inf
        if hit.kind < 0:
            continue
        point = any_shape.surface(shapes, ray, hit)
        owner = any_shape.owner(shapes, ray, hit)
        leaving = ray_from(point, row(w, i))
        again = any_shape.intersect(
            shapes, kind, rows[i], leaving, shear_of(leaving), no_hit(leaving)
        )
        out[i, 1], out[i, 2] = again.t, point.error
        out[i, 3], out[i, 4], out[i, 5] = point.p
        out[i, 6], out[i, 7], out[i, 8] = point.n
        out[i, 9], out[i, 10], out[i, 11] = leaving.o
        out[i, 12], out[i, 13], out[i, 14] = owner.u, owner.v, owner.face


def probe(shapes, kind, rows, o, d, w=None) -> Probe:
    """Ray i meets primitive rows[i] alone, then leaves what it hit towards w[i]."""
    o, d = np.ascontiguousarray(o, float), np.ascontiguousarray(d, float)
    w = d if w is None else np.ascontiguousarray(w, float)
    out = np.zeros((len(o), 15))
    with np.errstate(all="ignore"):
        _probe(shapes, kind, np.ascontiguousarray(rows, np.int64), o, d, w, out)
    return Probe(out)
