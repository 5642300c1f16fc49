"""Solids as the textbook would have them: all crossings of all operands, one after another in
order, with the whole expression evaluated at each.  Crossings and their errors are the renderer's.
"""

import math

import numpy as np

from reference_rt import shapes as any_shape
from reference_rt.accel.csg import GRAZING, head_on, width
from reference_rt.accel.mesh_crossings import next_mesh_crossing, winding
from reference_rt.core.ray import Hit, Ray
from reference_rt.core.vec3 import Vec3, row
from reference_rt.jit.kernel import entry_kernel
from reference_rt.shapes.csg import Solid, ray_near

MOST = 8
"""Crossings of an operand at most: of meshes as of others."""


@entry_kernel
def _of_operand(geometry, s, operand, o, d, t, widths, signs, state):
    solids, shapes, bvh = geometry.solids, geometry.shapes, geometry.bvh
    kind, i = solids.kind[operand], solids.row[operand]
    for n in range(len(o)):
        ray, _ = ray_near(solids, s, Ray(row(o, n), row(d, n), math.inf))
        count = 0
        if i < 0:
            root = solids.root[operand]
            state[n] = winding(shapes, bvh, root, ray)
            step = next_mesh_crossing(shapes, bvh, root, ray, 0.0, -1)
            while step.t < math.inf and count < MOST:
                t[n, count] = step.t
                hit = Hit(step.t, kind, step.row, step.u, step.v, -1)
                widths[n, count], signs[n, count] = width(shapes, hit, ray), step.sign
                count += 1
                step = next_mesh_crossing(shapes, bvh, root, ray, step.t, step.row)
        else:
            spans = any_shape.spans(shapes, kind, i, ray)
            before = 0
            for at, u in (
                (spans.t0, spans.u0),
                (spans.t1, spans.u1),
                (spans.t2, spans.u2),
                (spans.t3, spans.u3),
            ):
                if at <= 0.0:
                    before += 1
                elif at < math.inf:
                    t[n, count] = at
                    widths[n, count] = width(shapes, Hit(at, kind, i, u, 0.0, -1), ray)
                    signs[n, count] = 1 - 2 * ((before + count) % 2)
                    count += 1
            state[n] = before % 2


def inside(shape, states):
    """Whether a point is inside of a description: of each operand, from left to right, `states`
    says so."""
    if not isinstance(shape, Solid):
        return next(states)
    values = [inside(part, states) for part in shape.of]
    if shape.type == "union":
        return any(values)
    if shape.type == "intersection":
        return all(values)
    return values[0] and not any(values[1:])


def plain_crossings(geometry, s, shape, o, d, most):
    """As `solid_crossings`, of solid s, which is `shape`: t (n, most), width, part, count."""
    first, operands = geometry.solids.first[s], geometry.solids.operands[s]
    t, widths = np.full((2, operands, len(o), MOST), math.inf)
    signs = np.zeros(t.shape, np.int64)
    state = np.zeros((operands, len(o)), np.int64)
    with np.errstate(all="ignore"):
        for k in range(operands):
            _of_operand(geometry, s, first + k, o, d, t[k], widths[k], signs[k], state[k])
    found = np.full((2, len(o), most), math.inf)
    part, count = np.full((len(o), most), -1), np.zeros(len(o), np.int64)
    for n in range(len(o)):
        ray = Ray(Vec3(*o[n].tolist()), Vec3(*d[n].tolist()), math.inf)
        near, begin = ray_near(geometry.solids, s, ray)
        of_ray = t[:, n], widths[:, n], signs[:, n], state[:, n]
        for at, error, k in _along(shape, near, *of_ray):
            if count[n] < most:
                found[0, n, count[n]] = begin + at
                found[1, n, count[n]] = min(error, 0.5 * GRAZING * head_on(near, at))
                part[n, count[n]] = k
            count[n] += 1
    return found[0], found[1], part, count


def _along(shape, ray, t, widths, signs, state):
    """(t, width, operand) of the solid's crossings along a ray; of the operands' crossings t,
    widths and signs (k, MOST), and the states (k,) at its origin, not 0 for inside."""
    passed = np.zeros(len(t), int)

    def go_past(k):
        state[k] += signs[k, passed[k]]
        passed[k] += 1

    def nearest():
        ahead = np.array([t[k, passed[k]] if passed[k] < MOST else math.inf for k in range(len(t))])
        k = int(ahead.argmin())  # of several the first
        return (k, float(ahead[k])) if ahead[k] < math.inf else (-1, math.inf)

    def holds(states):
        return inside(shape, iter((states != 0).tolist()))

    at_origin = GRAZING * head_on(ray, 0.0)
    for k in range(len(t)):
        if t[k, 0] < at_origin and t[k, 0] <= widths[k, 0]:
            go_past(k)
    k, at = nearest()
    while k >= 0:
        before, members, reach = state.copy(), {}, at
        while k >= 0:
            members[k] = at, widths[k, passed[k]]
            previous, error = at, widths[k, passed[k]]
            go_past(k)
            k, at = nearest()
            if k < 0 or at - previous > GRAZING * head_on(ray, at):
                break
            reach = max(reach, previous + error)
            if at - widths[k, passed[k]] > reach:
                break
        if holds(before) != holds(state):
            shown = next(
                (i for i in sorted(members) if _decides(holds, before, state, i)), max(members)
            )
            yield *members[shown], shown


def _decides(holds, before, after, k):
    """Whether operand k alone changes the solid, or nothing does without it."""
    alone, without = before.copy(), after.copy()
    alone[k], without[k] = after[k], before[k]
    return holds(alone) != holds(before) or holds(without) == holds(before)
