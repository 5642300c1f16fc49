"""Compiled loops that call kernels without a public query for many inputs."""

import math

import numpy as np

from reference_rt import shapes as any_shape
from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import Hit, Ray, ray_from
from reference_rt.core.vec3 import row
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.shapes import TABLES
from reference_rt.shapes.meshes.watertight import shear_of


class Probe:
    """What `probe` finds for n rays; t and again are inf for a miss."""

    def __init__(self, out: FloatArray) -> None:
        self.out = out
        self.t, self.again, self.error = out[:, 0], out[:, 1], out[:, 2]
        self.p, self.n = out[:, 3:6], out[:, 6:9]
        self.start = out[:, 9:12]
        self.u, self.v, self.face = out[:, 12], out[:, 13], out[:, 14]


@kernel
def meet(shapes, kind, i, ray):
    """The hit of one primitive alone."""
    t, u, v = any_shape.intersect(shapes, kind, i, ray, shear_of(ray))
    return Hit(t, kind if t < math.inf else -1, i, u, v, -1)


@kernel
def probe_one(shapes, kind, i, ray, w, out):
    """A ray that meets a primitive, and leaves it towards w."""
    hit = meet(shapes, kind, i, ray)
    out[0] = hit.t
    out[1] = math.inf
    if hit.kind < 0:
        return
    point = any_shape.surface(shapes, ray, hit)
    u, v = any_shape.uv(shapes, ray, hit)
    leaving = ray_from(point, w)
    again = meet(shapes, kind, i, leaving)
    out[1], out[2] = again.t, point.error
    out[3], out[4], out[5] = point.p
    out[6], out[7], out[8] = point.n
    out[9], out[10], out[11] = leaving.o
    out[12], out[13], out[14] = u, v, any_shape.face(shapes, hit)


@entry_kernel
def _probe(shapes, kind, rows, o, d, w, out):
    for i in range(len(o)):
        probe_one(shapes, kind, rows[i], Ray(row(o, i), row(d, i), math.inf), row(w, i), out[i])


def probe(shapes, kind, rows, o, d, w=None) -> Probe:
    """Ray i meets primitive rows[i] alone, then leaves what it hit towards w[i]."""
    o, d = np.ascontiguousarray(o, float), np.ascontiguousarray(d, float)
    w = d if w is None else np.ascontiguousarray(w, float)
    out = np.zeros((len(o), 15))
    with np.errstate(all="ignore"):
        _probe(shapes, kind, np.ascontiguousarray(rows, np.int64), o, d, w, out)
    return Probe(out)


@entry_kernel
def _spans(geometry, kind, o, d, out):
    for i in range(len(o)):
        s = any_shape.spans(geometry.shapes, kind, 0, Ray(row(o, i), row(d, i), math.inf))
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = s.t0, s.t1, s.t2, s.t3


def spans_of(scene, o, d):
    """Where n rays cross the only shape of a scene, a solid: t0 to t3 (n, 4), inf for none."""
    shapes = scene.tables.geometry.shapes
    (kind,) = (code for code, field, _, _ in TABLES if getattr(shapes, field) is not None)
    out = np.zeros((len(o), 4))
    o, d = (np.ascontiguousarray(a, float) for a in (o, d))
    with np.errstate(all="ignore"):
        _spans(scene.tables.geometry, kind, o, d, out)
    return out
