"""Rasterising and casting give one picture of depths: exact, in every pixel that is no edge."""

import math
from fractions import Fraction as Q

import numpy as np
import pytest
from builders import U, random_turn
from rational import cross, dot, q, sub

import reference_rt as rt
from reference_rt import textbook

WIDTH, HEIGHT = 11, 7
METHODS = textbook.names("picture")


def seen_exactly(corners, o, d):
    """The exact t and the least barycentric of each triangle (n, 3, 3) for one ray."""
    found = []
    for v0, v1, v2 in corners:
        v0, e1, e2 = q(v0), sub(q(v1), q(v0)), sub(q(v2), q(v0))
        s, back = sub(q(o), v0), [-x for x in q(d)]
        whole = dot(e1, cross(e2, back))
        if whole == 0:
            continue
        three = (e1, e2, s), (s, e2, back), (e1, s, back)
        t, u, v = (dot(a, cross(b, c)) / whole for a, b, c in three)
        volume = abs(dot(s, cross(e1, e2)))
        found.append((t, min(u, v, 1 - u - v), volume, abs(whole)))
    return found


def cameras(rng, scale):
    """Turned any way, of any angle; off the axis and with oblong pixels."""
    eye = scale * rng.uniform(-3, 3, 3)
    turn = random_turn(rng)
    place = {"eye": eye, "target": eye + scale * turn[0], "up": turn[1]}
    l, b = rng.uniform(-2, 0.5, 2)
    w, h = 10 ** rng.uniform(-1, 0.7, 2)
    yield rt.Perspective(**place, fov=rng.uniform(2, 170))
    yield rt.Perspective(**place, view=(l, l + w, b, b + h))


def triangles(rng, camera, scale):
    """Around the camera: before, beside and behind it, through the plane of its eye; some cover the
    picture, some no pixel, some are thin; two share an edge."""
    at = rng.uniform(0, [WIDTH, HEIGHT], (9, 2)) - 0.5
    film = rt.Film(width=WIDTH, height=HEIGHT)
    eye, d = rt.Scene(camera=camera, film=film).camera_rays(at)
    depths = rng.uniform(-0.5, 4, (9, 1))
    middles = eye + scale * depths * d
    sizes = scale * (abs(depths) * 10 ** rng.uniform(-0.7, 1, (9, 1)))[..., None]
    v = middles[:, None] + sizes * rng.uniform(-1, 1, (9, 3, 3))
    v[1] = v[1, 0], v[1, 1], v[1, 0] + 0.4 * (v[1, 1] - v[1, 0]) + 1e-3 * (v[1, 2] - v[1, 0])
    v[2, :2] = v[3, :2]
    return v


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_all_find_the_depths(scale):
    """But for pixels within rounding of an edge.  A direction's error, some u, is seen by a
    triangle as U far |e|^2 |d| over its determinant, in its barycentrics; 256 covers the pixels'
    own coordinates, which are up to 11, and the roundings of the edge functions."""
    rng = np.random.default_rng(17)
    decided = hits = several = 0
    for _ in range(4):
        for camera in cameras(rng, scale):
            v = triangles(rng, camera, scale)
            shapes = tuple(rt.Triangle(v0=a, v1=b, v2=c) for a, b, c in v.tolist())
            film = rt.Film(width=WIDTH, height=HEIGHT)
            scene = rt.Scene(camera=camera, film=film, shapes=shapes)
            o, d = (a.reshape(-1, 3) for a in scene.camera_rays())
            d = d * 10.0 ** rng.uniform(-2, 2, (len(d), 1))
            parameters = textbook.SceneParameters(scene)
            found = {m: textbook.intersect(m, parameters, o, d) for m in METHODS}
            far = np.linalg.norm(v - np.array(camera.eye), axis=-1).max(axis=-1)
            # How much larger than 1 the picture's coordinates are, in pixels.
            _, _, right, down, _ = camera.setup(WIDTH, HEIGHT)
            pixels = 1.0 + max(WIDTH / np.linalg.norm(right), HEIGHT / np.linalg.norm(down))
            for k in range(len(o)):
                exact = seen_exactly(v, o[k], d[k])
                size = np.linalg.norm(d[k])
                slack = [
                    256 * U * pixels * f * f * (size / float(whole) + f / float(volume))
                    for f, (_, _, volume, whole) in zip(far, exact, strict=True)
                ]
                ahead = [(t, m, s) for s, (t, m, _, _) in zip(slack, exact, strict=True) if t > 0]
                if any(abs(m) <= s for _, m, s in ahead):
                    continue
                hit = [(t, s) for t, m, s in ahead if m > 0]
                nearest, off = min(hit, default=(math.inf, 0.0))
                decided += 1
                hits += nearest != math.inf
                several += len(hit) > 1
                for name, t in found.items():
                    if nearest == math.inf:
                        assert t[k] == math.inf, name
                    else:
                        assert abs(Q(float(t[k])) / nearest - 1) <= off, name
    # Of 8 pictures.
    assert decided > 0.97 * 8 * WIDTH * HEIGHT
    assert hits > 200
    assert several > 20


def test_the_order_of_triangles_does_not_matter():
    """The depth buffer keeps the nearest: the same bits."""
    rng = np.random.default_rng(18)
    (camera, _) = cameras(rng, 1.0)
    v = triangles(rng, camera, 1.0)
    pictures = []
    for order in (np.arange(9), np.arange(9)[::-1], rng.permutation(9)):
        shapes = tuple(rt.Triangle(v0=a, v1=b, v2=c) for a, b, c in v[order].tolist())
        scene = rt.Scene(camera=camera, film=rt.Film(width=32, height=24), shapes=shapes)
        o, d = (a.reshape(-1, 3) for a in scene.camera_rays())
        t = textbook.intersect("picture.rasterise", textbook.SceneParameters(scene), o, d)
        pictures.append(t)
    assert np.isfinite(pictures[0]).any()
    assert np.array_equal(pictures[0], pictures[1])
    assert np.array_equal(pictures[0], pictures[2])
