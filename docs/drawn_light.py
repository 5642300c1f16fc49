"""Drawings of the pages on light, and of those on verdicts."""

import itertools
import math

import numpy as np
from drawing import Drawing, FloatArray, Glass, View, ball, polar, unit

from reference_rt import Sphere


def index(drawing: Drawing) -> None:
    """What the pages are about, in one picture."""
    eye, lamp, glass = np.array([26.0, 158.0]), np.array([330.0, 264.0]), ball(322, 120, 62)
    drawing.box((0, 0), (600, 40))
    drawing.circle(glass.center, glass.radius, "glass")
    drawing.line((121, 96), (121, 220), kind="edge")
    for k in range(9):
        drawing.line((117, 96 + 15.5 * k), (125, 96 + 15.5 * k), kind="edge thin")
    floor = through(drawing, eye, (1, 0), glass, lamp, 40, (92, 60))
    drawing.dot(eye)
    drawing.cross(floor)
    drawing.texts("""
        80 66 ink cameras
        196 168 eye rays
        322 74 ink shapes
        192 206 normal shading
        226 256 eye mirrored
        314 110 eye refracted
        470 204 shadow shadow rays
        376 257 light light
        452 12 wrong precision: its own shadow?
    """)


def through(
    drawing: Drawing,
    eye: FloatArray,
    d: tuple[float, float],
    glass: Sphere,
    lamp: FloatArray,
    ground: float,
    lengths: tuple[float, float],
) -> FloatArray:
    """A ray from the eye at a ball of glass, what it becomes there, and shadow rays; returns where
    it ends on the ground.  lengths: of the mirrored ray and of the normal."""
    p, n, mirrored, _, q, out = Glass.hit(eye, d, glass)
    floor = q + (ground - q[1]) / out[1] * out
    drawing.arrow(eye, p, "eye")
    drawing.arrow(p, p + lengths[0] * mirrored, "eye")
    drawing.arrow(p, q, "eye")
    drawing.arrow(q, floor, "eye")
    drawing.arrow(p, p + lengths[1] * n, "normal")
    for each in (p, floor):
        drawing.arrow(each, lamp, "shadow", short=13)
    drawing.circle(lamp, 10, "lamp")
    drawing.dot(p)
    drawing.dot(q)
    return floor


def shading(drawing: Drawing) -> None:
    """Phong's and Blinn's vectors, a cosine below 0, and normals that are interpolated."""
    drawing.heads("vectors", "cosine below 0", "two normals", wrong=[1, 2])
    drawing.box((15, 43), (185, 65))
    view, n, light, to_eye = drawing.view((100, 65)), polar(90.0), polar(132.0), polar(20.0)
    for v, length, words, kind in (
        (light, 90, "*l*", "light"),
        (to_eye, 72, "*e*", "eye"),
        (n, 120, "*n*", "normal"),
        (unit(light + to_eye), 120, "*h*", "ink"),
        (2 * (light @ n) * n - light, 90, "*r*", "light"),
    ):
        view.arrow((0, 0), length * v, kind)
        view.text((length + 13) * v, words, kind, by=(0, -6))
    view.dot((0, 0))
    view, size, light = drawing.view((312, 128)), 50.0, polar(130.0)
    view.circle((0, 0), size)
    for start, kind in ((40, "light"), (220, "wrong")):
        angles = np.arange(start, start + 181, 5)
        curve = polar(angles, size * (1 + 0.8 * np.cos(np.radians(angles - 130))))
        view.area(*curve, *polar(angles[::-1], size), kind=f"{kind} f")
        view.line(*curve, kind=kind)
    view.arrow(2.6 * size * light, 1.95 * size * light, "light")
    view.text(2.6 * size * light, "*l*", "light", by=(14, -6))
    view, (left, peak, right) = drawing.view((500, 56)), polar([150.0, 90.0, 30.0], 96.0)
    view.area(left, peak, right, (right[0], 0), (left[0], 0))
    q, slope = 0.7 * peak + 0.3 * right, unit(right - peak)
    view.line(q - 100 * slope, q + 64 * slope, kind="guide")
    for v, length, words, kind, by in (
        (unit(right + peak), 80, "facet", "edge", (0, 8)),
        (unit(q), 62, "*n*", "normal", (-14, 0)),
        (polar(161.0), 105, "*l*", "light", (0, 10)),
    ):
        view.arrow(q, q + length * v, kind)
        view.text(q + length * v, words, kind, by=by)
    view.dot(q)
    drawing.texts("300 18 wrong cut off at 0 \n 500 18 wrong lit from behind")


def whitted(drawing: Drawing) -> None:
    """A mirrored, a refracted and a shadow ray; the tree that they make."""
    drawing.heads("three rays at a hit", "the tree, cut off", wrong=[1])
    glass, lamp, eye = ball(114, 126, 56), np.array([156.0, 250.0]), np.array([8.0, 168.0])
    drawing.box((0, 0), (292, 68))
    drawing.circle(glass.center, glass.radius, "glass")
    drawing.dot(through(drawing, eye, (1, -0.06), glass, lamp, 68, (66, 58)))
    drawing.texts("12 178 eye *I* \n 50 230 eye *R* \n 122 126 eye *T* \n 24 214 normal *N*")
    drawing.texts("256 170 shadow shadow \n 452 14 wrong below max_depth: black")
    above: list[tuple[float, float]] = []
    for level in range(4):
        spots = [(340 + (k + 0.5) * 224 / 2**level, 238 - 62 * level) for k in range(2**level)]
        kind = "wrong" if level == 3 else "eye"
        for k, p in enumerate(spots):
            if above:
                drawing.line(above[k // 2], p, kind=kind)
        for p in above:
            drawing.dot(p, "eye", 6)
        drawing.text((322, 231 - 62 * level), str(2**level), kind)
        above = spots
    for p in above:
        drawing.cross(p)


def path(drawing: Drawing) -> None:
    """Both samplers of one surface; directions that are drawn by another density than weighted."""
    drawing.heads("two samplers, one lamp", "the wrong cosine", wrong=[1])
    low, high, x, y = (
        np.array(p) for p in ((92.0, 238.0), (190.0, 238.0), (116.0, 44.0), (272.0, 120.0))
    )
    drawing.box((0, 14), (272, 44))
    drawing.box((272, 14), (292, 200))
    drawing.box(low, (high[0], high[1] + 14), "lamp")
    drawing.area(x, low, high, kind="light f")
    drawing.arrow((16, 170), x, "eye")
    drawing.arrow(x, low + 0.38 * (high - low), "shadow")
    drawing.arrow(x, y, "eye")
    drawing.arrow(x, low + 0.8 * (high - low), "eye")
    drawing.arrow(y, low + 0.7 * (high - low), "shadow")
    drawing.dot(x)
    drawing.dot(y)
    drawing.texts("50 196 shadow by lamp \n 224 51 eye by BSDF")
    even = (np.arange(11) + 0.5) / 11 * 2 - 1
    # In the plane of the drawing: points of the disk, lifted; zones of equal area.
    lifted = np.stack([even, np.sqrt(1 - even**2)], axis=-1)
    zones = np.stack([np.sign(even) * np.sqrt(1 - (1 - abs(even)) ** 2), 1 - abs(even)], axis=-1)
    for at, directions, kind, words in (
        (166, lifted, "eye", "*p* = cos *θ* / π"),
        (34, zones, "wrong", "uniform, same weight"),
    ):
        view = drawing.view((450, at), 88)
        view.line((-1.2, 0), (1.2, 0), kind="edge")
        for d in directions:
            if kind == "eye":
                view.line((d[0], 0), d, kind="grid")
            view.arrow((0, 0), d, f"{kind} thin", 8)
        view.text((0, 0), words, kind, by=(0, -25))


def light(drawing: Drawing) -> None:
    """Particles that are connected with the camera; a surface that is inclined meets fewer."""
    drawing.heads("particles, connected", "a cosine too many", wrong=[1])
    glass, lamp, camera = ball(104, 138, 48), np.array([64.0, 252.0]), np.array([270.0, 170.0])
    drawing.box((0, 14), (292, 38))
    drawing.circle(glass.center, glass.radius, "glass")
    axis = math.degrees(math.atan2(138 - lamp[1], 104 - lamp[0]))
    for angle in np.linspace(-19, 19, 7):
        p, *_, q, out = Glass.hit(lamp, polar(axis + angle), glass)
        floor = q + (38 - q[1]) / out[1] * out
        drawing.line(lamp, p, q, kind="light thin")
        drawing.arrow(q, floor, "light thin", 8)
        drawing.line(floor, camera, kind="guide")
    drawing.circle(lamp, 9, "lamp")
    drawing.dot(camera, "eye", 7)
    drawing.text((250, 184), "camera", "eye")
    for x, tilt in ((376, 0.0), (524, 60.0)):
        view, length, along = drawing.view((x, 110)), 64.0, polar(tilt)
        side = 14 * np.array([along[1], -along[0]])
        ends = -length * along, length * along
        view.area(*ends, ends[1] + side, ends[0] + side)
        places = 11.0 * (np.arange(12) - 5.5)
        met = abs(places) < ends[1][0]
        for place, meets in zip(places, met, strict=True):
            end = place * along[1] / along[0] if meets else -66.0
            view.arrow((place, 128), (place, end), "light thin" if meets else "guide", 8)
        drawing.text((x, 16), f"{met.sum()} arrive", "light")


def media(drawing: Drawing) -> None:
    """Free flights, shadow rays through fog, and a weight that one density does not bound."""
    drawing.heads("flights in fog", "weights of blue", wrong=[1])
    drawing.box((30, 52), (286, 200), "edge f")
    places, sigma, lamp = [np.array([30.0, 128.0])], 0.012, np.array([186.0, 246.0])
    for u, angle in ((0.6, -8.0), (0.5, -50.0), (0.6, 40.0)):
        places.append(places[-1] - math.log(1 - u) / sigma * polar(angle))
    drawing.line(places[0] - 24 * polar(-8.0), places[0], kind="eye")
    for start, end in itertools.pairwise(places):
        drawing.arrow(start, end, "eye")
        drawing.arrow(end, lamp, "shadow", short=13)
        drawing.dot(end)
    drawing.circle(lamp, 10, "lamp")
    # Blue is thin, red thick: the weight for blue of flights drawn for red, or for any of three.
    t, thick = np.linspace(0, 6, 121), np.array([[1.0], [0.6], [0.3]])
    density = thick * np.exp(-thick * t)
    view = axes(drawing, (340, 38), (38, 46), 248, 214)
    view.line((0, 3), (6.3, 3), kind="guide")
    for weight, kind in (
        (density[2] / density[0], "wrong"),
        (density[2] / density.mean(axis=0), "eye"),
    ):
        view.line(*np.stack([t, weight], axis=-1)[weight < 4.5], kind=kind)
    drawing.texts("""
        72 140 eye *t*
        96 176 shadow dimmed
        150 18 eye *t* = −ln(1 − *u*) / *σ*
        582 48 ink *t*
        326 169 ink 3
        494 234 wrong:start red's
        494 210 wrong:start density
        450 72 eye:start the mean's
    """)


def axes(drawing: Drawing, at: tuple[float, float], scale: object, x: float, y: float) -> View:
    """Of a chart, x and y long."""
    drawing.arrow(at, (at[0] + x, at[1]), "edge")
    drawing.arrow(at, (at[0], at[1] + y), "edge")
    return drawing.view(at, scale)


def derivatives(drawing: Drawing) -> None:
    """An edge that moves between samples; the pixel and its samples against the parameter."""
    drawing.heads("the edge moves", "what samples see", wrong=[1])
    n, rng, c, r, step = 6, np.random.default_rng(3), np.array([-0.35, -0.3]), 0.98, 0.13
    cells = np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=-1)
    samples = ((cells + rng.uniform(0.12, 0.88, (n, n, 2))) / n).reshape(-1, 2)
    far = np.linalg.norm(samples - c, axis=-1)
    view = drawing.view((50, 52), 200)
    arcs = [c + polar(np.linspace(0, 90, 181), radius) for radius in (r, r + step)]
    inner, outer = (arc[(arc >= 0).all(axis=-1)] for arc in arcs)
    view.area(*inner, (0, 0))
    view.area(*inner, *outer[::-1], kind="wrong f")
    view.arrow(inner[len(inner) // 2], outer[len(outer) // 2], "wrong")
    for p, away in zip(samples, far, strict=True):
        (view.dot if away < r else view.ring)(p)
    view.box((0, 0), (1, 1), "edge")
    # What is covered: of a fine grid, and of the samples.
    radii, fine = np.linspace(0.86, 1.22, 181), (np.arange(200) + 0.5) / 200
    grid = np.hypot(fine[:, None] - c[0], fine - c[1])
    axes(drawing, (330, 42), 1, 256, 214)
    view = drawing.view((330, 42), (660, 480), (0.86, 0.06))
    for distances, kind in ((grid, "eye"), (far, "wrong")):
        share = [(distances < radius).mean() for radius in radii]
        view.line(*zip(radii, share, strict=True), kind=kind)
    drawing.texts("""
        150 18 ink a pixel, 36 samples
        578 52 ink *r*
        440 202 eye the pixel
        516 78 wrong steps: slope 0
    """)


def verdict(drawing: Drawing) -> None:
    """Two pictures with noise, their difference over its standard error, and what may follow."""
    drawing.heads("ours", "another", "difference / error")
    rng, n, error = np.random.default_rng(8), 12, 0.05
    y, x = np.mgrid[:n, :n] + 0.5
    right = 0.55 + 0.35 * np.exp(-((x - 5) ** 2 + (y - 7) ** 2) / 14)
    ours, other = (right + error * rng.standard_normal((n, n)) for _ in range(2))
    other -= np.where((abs(x - 8.5) < 2) & (abs(y - 3.5) < 2), 0.16, 0.0)  # the fault
    z = (other - ours) / (error * math.sqrt(2))
    white, low, high = np.full(3, 255), np.array([0, 96, 168]), np.array([189, 58, 15])
    for k, (values, most) in enumerate(((ours, 1), (other, 1), (z, 4))):
        view, levels = drawing.view((34 + 200 * k, 128), 11.0), np.rint(values / most * 16)
        for level in np.unique(levels):
            share = min(abs(level) / 16, 1)
            signed = white + share * ((high if level > 0 else low) - white)
            colour = np.rint(white * share if k < 2 else signed).astype(int)
            view.cells(np.argwhere(levels == level)[:, ::-1], "#{:02x}{:02x}{:02x}".format(*colour))
        view.box((0, 0), (n, n), "edge")
    for x, words, middle, half, kind in (
        (100, "agree", 6, 14, "normal"),
        (300, "differ", 64, 15, "wrong"),
        (500, "inconclusive", 10, 62, "light"),
    ):
        interval(drawing.view((x, 70)), middle, half, kind)
        drawing.text((x, 18), words, f"{kind} b")


def interval(view: View, middle: float, half: float, kind: str) -> None:
    """An estimate with its confidence interval, beside what is permitted."""
    view.box((-32, -18), (32, 18), "edge f")
    view.line((0, -22), (0, 22), kind="edge thin")
    view.line((middle - half, 0), (middle + half, 0), kind=kind)
    for end in (middle - half, middle + half):
        view.line((end, -9), (end, 9), kind=kind)
    view.dot((middle, 0), kind)


def truth(drawing: Drawing) -> None:
    """A row of a floor under a disk lamp: the formula, renders, and others that lack a cosine."""
    drawing.heads("a lamp over a floor", "one formula, renders", wrong=[])
    h, r, rng = 1.5, 0.9, np.random.default_rng(2)
    view = drawing.view((150, 88), 72)
    view.box((-1.9, -0.22), (1.9, 0))
    view.box((-r, h), (r, h + 0.14), "lamp")
    view.area((0.9, 0), (-r, h), (r, h), kind="light f")
    view.arrow((0.9, 0), (0.9, 0.7), "normal")
    view.dot((0.9, 0))
    view.text((0.9, 0), "*x*", by=(16, 14))
    x = np.linspace(-2, 2, 81)
    square = x**2 + h**2
    formula = 0.5 * (1 - (square - r**2) / np.sqrt((square + r**2) ** 2 - 4 * (r * x) ** 2))
    view = drawing.view((452, 98), (62, 420))
    view.arrow((-2.15, 0), (2.25, 0), "edge")
    view.line(*np.stack([x, formula], axis=-1), kind="ink")
    for at in np.arange(-1.8, 1.9, 0.4):
        u, angle = rng.random((2, 4, 8))
        lamp = polar(360 * angle, r * np.sqrt(u))
        square = (lamp[..., 0] - at) ** 2 + lamp[..., 1] ** 2 + h**2
        for values, kind in ((r**2 * h**2 / square**2, "eye"), (r**2 * h / square**1.5, "wrong")):
            mean, error = values.mean(), values.mean(axis=1).std(ddof=1) / 2
            view.line((at, mean - error), (at, mean + error), kind=kind)
            view.dot((at, mean), kind, 4)
    drawing.texts("""
        150 30 ink light at *x*, by formula
        450 46 eye right: within its noise
        450 18 wrong a cosine less: off
    """)


def gate(drawing: Drawing) -> None:
    """Eight pictures each, what their means say, and the exit code."""
    rng, quantile = np.random.default_rng(4), 2.365  # Student's t: 97.5 % with 7 degrees of freedom
    drawing.text((150, 274), "8 pictures, limit ±0.5 %", "ink b")
    drawing.text((420, 274), "verdict", "ink b")
    drawing.text((555, 274), "exit", "ink b")
    for y, words, code, kind, middle, spread in (
        (232, "agree", 0, "normal", 0.05, 0.22),
        (182, "differ", 1, "wrong", 1.6, 0.22),
        (132, "inconclusive", 1, "light", 0.3, 1.3),
        (82, "invalid", 3, "wrong", None, None),
        (32, "no picture", 4, "wrong", None, None),
    ):
        drawing.text((420, y - 7), words, f"{kind} b")
        drawing.text((555, y - 7), str(code), f"{kind} b")
        if middle is None:
            drawing.box((133, y - 17), (167, y + 17), "edge" if code == 3 else "guide")
            drawing.cross((150, y))
            continue
        means = 32 * (middle + spread * rng.standard_normal(8))
        view = drawing.view((150, y))
        interval(view, means.mean(), quantile * means.std(ddof=1) / math.sqrt(8), kind)
        for mean in means:
            view.dot((mean, -13), "ink", 3)
