"""Helpers for tests of quadrics: rays, what the kernels return for them, and checks."""

import math
from fractions import Fraction

import numpy as np
from quadric_exact import exactly, extent, first, middle, side

from reference_rt.core.arrays import FloatArray
from reference_rt.core.ray import Hit, Ray, ray_from
from reference_rt.core.transform import Matrix
from reference_rt.core.vec3 import dot, frame_from_normal, row
from reference_rt.jit.kernel import entry_kernel, kernel
from reference_rt.shapes import QUADRIC
from reference_rt.shapes.curved import quadrics
from reference_rt.shapes.shape import TabulationContext

# ---- what the kernels say -----------------------------------------------------------------------


class Probe:
    """t, face and uv of n rays; p, n, error of the points; the side (±1) on which these are left
    towards w from `o`, and the t and face that are met next."""

    def __init__(self, out: FloatArray) -> None:
        self.t, self.face, self.u, self.v, self.error = out[:, :5].T
        self.p, self.n, self.o, self.w = out[:, 5:8], out[:, 8:11], out[:, 11:14], out[:, 14:17]
        self.next_t, self.next_face = out[:, 17], out[:, 18]
        self.side = np.where(out[:, 19] < 0.0, -1, 1)
        self.hits = np.flatnonzero(np.isfinite(self.t))


@kernel
def probe_one(table, o, d, guide, out):
    """One ray: what it meets, and what it meets next when it leaves towards `guide`, which is given
    in a frame around the normal."""
    ray = Ray(o, d, math.inf)
    found = quadrics.intersect(table, 0, ray)
    out[0] = found.t
    if not found.t < math.inf:
        return
    hit = Hit(found.t, QUADRIC, 0, found.u, found.v, -1)
    point = quadrics.surface(table, ray, hit)
    out[1], out[4] = quadrics.face_of(table, hit), point.error
    out[2], out[3] = quadrics.uv(table, ray, hit)
    frame = frame_from_normal(point.n)
    w = frame.s * guide.x + frame.t * guide.y + frame.n * guide.z
    leaving = ray_from(point, w)
    again = quadrics.intersect(table, 0, leaving)
    out[5], out[6], out[7] = point.p
    out[8], out[9], out[10] = point.n
    out[11], out[12], out[13] = leaving.o
    out[14], out[15], out[16] = w
    out[17], out[18], out[19] = again.t, again.u, dot(w, point.n)


@entry_kernel
def _probe(table, o, d, guides, out):
    for i in range(len(o)):
        probe_one(table, row(o, i), row(d, i), row(guides, i), out[i])


def table_of(shape):
    return shape.tabulate(TabulationContext())


def probe(shape, o, d, guides=None) -> Probe:
    o, d = (np.ascontiguousarray(a, float) for a in (o, d))
    guides = np.tile([0.6, 0.0, 0.8], (len(o), 1)) if guides is None else guides
    out = np.zeros((len(o), 20))
    with np.errstate(all="ignore"):
        _probe(table_of(shape), o, d, guides, out)
    return Probe(out)


@entry_kernel
def _all_spans(table, o, d, out):
    for i in range(len(o)):
        s = quadrics.spans(table, 0, Ray(row(o, i), row(d, i), math.inf))
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = s.t0, s.t1, s.t2, s.t3
        out[i, 4], out[i, 5], out[i, 6], out[i, 7] = s.u0, s.u1, s.u2, s.u3


def all_spans(shape, o, d):
    """(t (n, 4), face (n, 4)) of `spans`."""
    out = np.zeros((len(o), 8))
    with np.errstate(all="ignore"):
        _all_spans(table_of(shape), o, d, out)
    return out[:, :4], out[:, 4:]


# ---- rays and places ----------------------------------------------------------------------------


def rotation(rng):
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q


def put(shape, linear, offset=(0.0, 0.0, 0.0)):
    """The shape under an affine map."""
    m = np.column_stack([linear, offset])
    return shape.model_copy(update={"transform": (Matrix(matrix=tuple(map(tuple, m.tolist()))),)})


def anywhere(rng, shape, spread):
    """The shape, turned, scaled by 10^(-spread) to 10^spread along three axes, turned again and
    moved."""
    scale = np.diag(10.0 ** rng.uniform(-spread, spread, 3))
    return put(shape, rotation(rng) @ scale @ rotation(rng), rng.uniform(-3.0, 3.0, 3))


def rays_at(rng, exact, n, distance=(0.0, 1.0)):
    """Rays at points of the box, from 10^distance of its sizes, with |d| from 1e-3 to 1e3 of it."""
    half = np.array([float(b - a) / 2 for a, b in zip(exact.lower, exact.upper, strict=True)])
    target = middle(exact) + rng.uniform(-1.05, 1.05, (n, 3)) * half @ exact.m[:, :3].T
    v = rng.normal(size=(n, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    o = target + v * extent(exact) * 10.0 ** rng.uniform(*distance, (n, 1))
    return o, (target - o) * 10.0 ** rng.uniform(-3.0, 3.0, (n, 1))


def guides_at(rng, n):
    """Unit directions around a normal, on both sides, most of them grazing: down to 1e-18 and 0."""
    phi = rng.uniform(0.0, 2.0 * math.pi, n)
    z = rng.choice([-1.0, 1.0], n) * 10.0 ** -rng.uniform(0.0, 18.0, n)
    z[rng.random(n) < 0.1] = 0.0
    r = np.sqrt(1.0 - z * z)
    return np.column_stack([r * np.cos(phi), r * np.sin(phi), z])


# ---- checks -------------------------------------------------------------------------------------

ULP = 2.0**-52


def check_against_exact(shape, o, d, ulps=16.0, bend=256.0):
    """Every ray: hit or miss, face, t and point to `ulps` of |t| + size over the cosine, and the
    normal, where the radius of curvature is size / `bend` at least; the number of hits."""
    exact = exactly(shape)
    found = probe(shape, o, d)
    for i in range(len(o)):
        true = first(exact, o[i], d[i])
        assert np.isfinite(found.t[i]) == (true.t is not None), (i, true)
        if true.t is None:
            continue
        assert found.face[i] == true.face, (i, true)
        scale = float(true.t) + extent(exact) / np.linalg.norm(d[i])
        error = abs(float(Fraction(float(found.t[i])) - true.t))
        assert error * true.cos <= ulps * ULP * scale, (i, error / (ULP * scale), true)
        # Of the point, next to the exact one; its shift along the surface turns the normal by
        # shift / radius of curvature.
        shift = ulps * ULP * scale * np.linalg.norm(d[i]) / true.cos
        p = [float(Fraction(x) + true.t * Fraction(y)) for x, y in zip(o[i], d[i], strict=True)]
        assert np.linalg.norm(found.p[i] - p) <= 4.0 * shift, (i, true)
        turned = np.abs(found.n[i] - true.n).max()
        assert turned <= bend * shift / extent(exact), (i, turned, true)
    return len(found.hits)


def check_leaving(shape, o, d, guides, every=10, ulps=16.0):
    """Every ray that leaves begins on its side, and what it meets next, where that is near, and
    `every` so often elsewhere, is what is there; the number of hits.

    The surface's own errors are how finely rays see it: a thin shape's map rounds more.
    """
    exact = exactly(shape)
    size = extent(exact)
    found = probe(shape, o, d, guides)
    rounding = found.error[found.hits].max(initial=0.0)
    for i in found.hits:
        if found.face[i] == 0:
            f = side(exact, found.o[i])
            assert (f > 0) - (f < 0) == found.side[i], (i, float(f))
        t = found.next_t[i]
        if t >= 1e-4 * size and i % every:
            continue
        true = first(exact, found.o[i], found.w[i])
        if np.isinf(t):
            assert true.t is None or true.cos < 1e-6, (i, true)
        else:
            assert true.t is not None, (i, t / size)
            allowed = ulps * ULP * (size + t) + rounding
            assert abs(float(true.t) - t) * true.cos <= allowed, (i, t, true)
    return len(found.hits)
