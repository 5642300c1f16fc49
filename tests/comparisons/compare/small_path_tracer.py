"""A path tracer of one scene, which shares nothing with ours: a ball on a floor, under a sky and a
point light."""

import numpy as np

from comparisons.results.case import FloatArray

WIDTH, HEIGHT = 48, 36

SCENE = """
camera: {type: perspective, eye: [0, 1.2, 4], target: [0, 0.6, 0], fov: 40}
film: {width: 48, height: 36}
sampler: {type: sobol, spp: 64}
integrator: {type: path, max_depth: 4}
materials:
  floor: {type: diffuse, reflectance: [0.5, 0.4, 0.3]}
  clay: {type: diffuse, reflectance: 0.7}
shapes:
  - type: rectangle
    material: floor
    transform: [{scale: 5}, {rotate: {axis: [1, 0, 0], degrees: -90}}]
  - {type: sphere, material: clay, center: [0, 0.6, 0], radius: 0.6}
lights:
  - {type: constant, radiance: 0.5}
  - {type: point, position: [2, 4, 2], intensity: [20, 18, 15]}
"""

GLASS = SCENE.replace("clay: {type: diffuse, reflectance: 0.7}", "clay: {type: dielectric}")
"""With a ball of glass."""

DIRECT = SCENE.replace("{type: path, max_depth: 4}", "{type: direct}")
WHITTED = GLASS.replace("{type: path, max_depth: 4}", "{type: whitted, max_depth: 4}")
"""With direct light alone, and with mirrored and refracted rays alone."""

CENTRE, RADIUS = np.array([0.0, 0.6, 0.0]), 0.6
LIGHT, INTENSITY = np.array([2.0, 4.0, 2.0]), np.array([20.0, 18.0, 15.0])
SKY, EYE, TARGET = 0.5, np.array([0.0, 1.2, 4.0]), np.array([0.0, 0.6, 0.0])


def _hit(p: FloatArray, d: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The distance to the first surface, inf without one, and whether it is the ball."""
    with np.errstate(all="ignore"):
        floor = -p[:, 1] / d[:, 1]
        q = p + floor[:, None] * d
        is_there = (floor > 1e-6) & (abs(q[:, 0]) <= 5) & (abs(q[:, 2]) <= 5)
        floor = np.where(is_there, floor, np.inf)
        away = p - CENTRE
        b = (away * d).sum(axis=1)
        square = b * b - (away * away).sum(axis=1) + RADIUS**2
        root = np.sqrt(np.maximum(square, 0.0))
        near, far = -b - root, -b + root
        ball = np.where(near > 1e-6, near, np.where(far > 1e-6, far, np.inf))
        ball = np.where(square > 0.0, ball, np.inf)
    return np.minimum(floor, ball), ball < floor


def _around(n: FloatArray, rng: np.random.Generator, uniform: bool = False) -> FloatArray:
    """Directions on the side of the normals, by the density of the cosine or uniform."""
    first, angle = rng.random(len(n)), 2.0 * np.pi * rng.random(len(n))
    z = first if uniform else np.sqrt(1.0 - first)
    aside = np.sqrt(1.0 - z * z)
    other = np.where(abs(n[:, :1]) > 0.9, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    s = np.cross(n, other)
    s /= np.linalg.norm(s, axis=1)[:, None]
    d = s * (aside * np.cos(angle))[:, None] + n * z[:, None]
    return d + np.cross(n, s) * (aside * np.sin(angle))[:, None]


def _through_glass(
    d: FloatArray, n: FloatArray, u: FloatArray, mistake: str
) -> tuple[FloatArray, FloatArray]:
    """Directions mirrored or refracted by glass with outward normals n, drawn by the numbers u, and
    the factor of what they carry."""
    cosine = -(d * n).sum(axis=1)
    ratio = np.where(cosine > 0.0, 1.0 / 1.5, 1.5)  # of the indices, here over there
    facing = n * np.sign(cosine)[:, None]
    cosine = np.abs(cosine)
    square = 1.0 - ratio**2 * (1.0 - cosine**2)
    is_total = square <= 0.0
    behind = np.sqrt(np.maximum(square, 0.0))
    across = ((ratio * cosine - behind) / (ratio * cosine + behind)) ** 2
    along = ((ratio * behind - cosine) / (ratio * behind + cosine)) ** 2
    mirrored = 0.5 * (across + along)
    if mistake.startswith("glass mirrors"):
        mirrored = np.full(len(d), 0.0 if mistake == "glass mirrors nothing" else 0.5)
    mirrored = np.where(is_total, 1.0, mirrored)
    is_mirrored = (u < mirrored)[:, None]
    back = d + 2.0 * cosine[:, None] * facing
    on = ratio[:, None] * d + (ratio * cosine - behind)[:, None] * facing
    return np.where(is_mirrored, back, on), np.where(is_mirrored[:, 0], 1.0, ratio**2)


OF_ALL_LIGHTS = (
    "samples of the sky",
    "no shadows of any light",
    "no shadows at the first surface",
    "no shadows at later surfaces",
    "no pi for any light",
)
"""With these, the first of which is no mistake, the sky's light is found by samples of it."""


def picture(spp: int, seed: int, mistake: str = "", scene: str = SCENE) -> FloatArray:
    """(height, width, 3), of one of the scenes.  mistake: "no shadows", "uniform", "no pi",
    "no cosine", "1 / d", "twice", "one bounce less", "cosine twice", "0.8 a bounce", "roulette",
    "glass mirrors nothing", "glass mirrors half", one of OF_ALL_LIGHTS or none."""
    rng = np.random.default_rng(seed)
    glass, is_whitted = scene in (GLASS, WHITTED), scene is WHITTED
    forward = (TARGET - EYE) / np.linalg.norm(TARGET - EYE)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    up, half = np.cross(right, forward), np.tan(np.radians(20.0))
    y, x = (np.tile(k.ravel(), spp) for k in np.mgrid[:HEIGHT, :WIDTH])
    count = len(x)
    u = (2.0 * (x + rng.random(count)) / WIDTH - 1.0) * half
    v = (1.0 - 2.0 * (y + rng.random(count)) / HEIGHT) * half * HEIGHT / WIDTH
    d = forward + u[:, None] * right + v[:, None] * up
    d /= np.linalg.norm(d, axis=1)[:, None]
    p = np.tile(EYE, (count, 1))
    colour, weight = np.zeros((count, 3)), np.ones((count, 3))
    alive = np.ones(count, dtype=bool)
    edges = {DIRECT: 2, WHITTED: 6}.get(scene, 3 if mistake == "one bounce less" else 4)
    for edge in range(edges):
        t, is_ball = _hit(p, d)
        missed = alive & ~np.isfinite(t)
        if edge == 0 or mistake not in OF_ALL_LIGHTS:
            colour[missed] += weight[missed] * SKY * (2.0 if edge and mistake == "twice" else 1.0)
        alive &= np.isfinite(t)
        if edge + 1 == edges:
            break
        p = p + np.where(alive, t, 0.0)[:, None] * d
        n = np.where(is_ball[:, None], (p - CENTRE) / RADIUS, [0.0, 1.0, 0.0])
        is_glass = is_ball & glass
        alive &= is_glass | ((n * d).sum(axis=1) < 0.0)
        albedo = np.where(is_ball[:, None], 0.7, [0.5, 0.4, 0.3])
        to_light = LIGHT - p
        distance = np.linalg.norm(to_light, axis=1)
        to_light /= distance[:, None]
        cosine = np.maximum((n * to_light).sum(axis=1), 0.0)
        beyond, _ = _hit(p + 1e-5 * n, to_light)
        where = "the first surface" if edge == 0 else "later surfaces"
        no_shadows = mistake in ("no shadows of any light", f"no shadows at {where}")
        lit = alive & (cosine > 0.0) & ~is_glass
        lit &= (beyond > distance) | no_shadows | (mistake == "no shadows")
        factor = np.ones_like(cosine) if mistake == "no cosine" else cosine
        factor = factor / distance ** (1.0 if mistake == "1 / d" else 2.0)
        factor = factor / (1.0 if mistake.startswith("no pi") else np.pi)
        factor = factor * (cosine if mistake == "cosine twice" else 1.0)
        colour[lit] += (weight * albedo * factor[:, None] * INTENSITY)[lit]
        if mistake in OF_ALL_LIGHTS:
            beyond, _ = _hit(p + 1e-5 * n, _around(n, rng))
            seen = alive & (~np.isfinite(beyond) | no_shadows)
            times = np.pi if mistake == "no pi for any light" else 1.0
            colour[seen] += times * SKY * (weight * albedo)[seen]
        carried = albedo * (0.8 if mistake == "0.8 a bounce" else 1.0)
        following = _around(n, rng, mistake == "uniform")
        if mistake == "cosine twice":
            carried = carried * (following * n).sum(axis=1)[:, None]
        if glass:
            through, radiance = _through_glass(d, n, rng.random(count), mistake)
            following = np.where(is_glass[:, None], through, following)
            carried = np.where(is_glass[:, None], radiance[:, None], carried)
        d, weight = following, weight * carried
        p = p + 1e-5 * n * np.sign((n * d).sum(axis=1))[:, None]
        if is_whitted:
            alive &= is_glass
        if mistake == "roulette" and edge >= 1:
            alive &= rng.random(count) < np.minimum(weight.max(axis=1), 0.95)
    return colour.reshape(spp, HEIGHT, WIDTH, 3).mean(axis=0)
