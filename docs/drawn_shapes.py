"""Drawings of the pages on rays, cameras and shapes."""

import math

import numpy as np
import numpy.typing as npt
from drawing import Drawing, FloatArray, ball, crossings, polar, unit


def rays(drawing: Drawing) -> None:
    """The smallest t above 0; a lamp's shadow ray ends at the lamp."""
    o, d = np.zeros(2), np.array([1.4, 0.0])
    balls = ball(-1.5, 0.1, 0.6), ball(3.6, 0.25, 0.75), ball(6.2, -0.1, 0.7)
    view = drawing.view((150, 195), 62)
    for each in balls:
        view.circle(each.center, each.radius)
    behind, ahead = -crossings(o, -d, *balls), crossings(o, d, *balls)
    view.line(behind[-1] * d - (0.3, 0), o, kind="guide")
    view.arrow(o, (7.2, 0), "eye thin")
    view.arrow(o, d, "eye")
    for t in behind:
        view.cross(t * d)
    for t in ahead[1:]:
        view.ring(t * d)
    view.dot(o)
    view.dot(ahead[0] * d, "eye", 7)
    lamp, wall = np.array([5.6, 0.0]), ball(7.6, 0.1, 0.55)
    view = drawing.view((70, 42), 62)
    view.box((-0.5, -0.55), (0, 0.5))
    view.circle(wall.center, wall.radius)
    view.line(lamp, (8.4, 0), kind="guide")
    view.circle(lamp, 0.2, "lamp")
    view.arrow(o, lamp, "shadow", short=13)
    view.dot(o)
    for t in crossings(o, lamp, wall):
        view.cross(t * lamp)
    drawing.text((12, 272), "closest hit: the smallest *t* > 0", "ink b", anchor="start")
    drawing.text((12, 92), "shadow ray: any hit with 0 < *t* < 1", "ink b", anchor="start")
    drawing.texts("""
        150 169 ink *o*
        193 207 eye *d*
        237 169 eye *t* = 1
        60 133 wrong *t* < 0
        333 133 eye counts
        534 125 ink later
        244 14 shadow *t* from 0 to 1
        417 8 ink lamp
        541 88 wrong *t* > 1
    """)


def sphere(drawing: Drawing) -> None:
    """Two roots, one, none; and roots of a rounded discriminant."""
    drawing.heads("three cases of *D*", "from 30,000,000 radii", wrong=[1])
    view, d, o = drawing.view((165, 130), 82), np.array([1.0, 0.0]), np.array([-1.85, -0.45])
    view.circle((0, 0), 1)
    for y in (1.0, 1.35):
        view.arrow((o[0], y), (1.4, y), "eye thin")
    view.arrow(o, (1.4, o[1]), "eye")
    first, last = (o + t * d for t in crossings(o, d, ball(0, 0, 1)))
    view.arrow(first, 1.55 * first, "normal")
    view.dot((0, 0))
    view.dot((0, 1), "eye")
    view.dot(first, "eye", 7)
    view.ring(last)
    view.text((0, 0), "*c*", by=(14, 6))
    view.text(1.55 * first, "*n*", "normal", by=(-12, -12))
    view.text(first, "*t*₀", "eye", by=(24, 10))
    view.text(last, "*t*₁", by=(-22, 10))
    for y, words in ((1.35, "*D* < 0"), (1.0, "*D* = 0"), (o[1], "*D* > 0")):
        view.text((-1.9, y), words, by=(-2, 9), anchor="start")
    view, far, ys = drawing.view((505, 128), 110), 3.0e7, np.linspace(-1.02, 1.02, 83)
    slope = ys / far  # the ray from (-far, 0) in the direction (1, slope)
    a, b, c = 1 + slope**2, -2 * far, far**2 - 1
    D = b**2 - 4 * a * c
    view.area(*polar(np.linspace(90, 270, 61)))
    for y, each, of_a in zip(ys, D, a, strict=True):
        if each >= 0:
            view.dot(((-b - math.sqrt(each)) / (2 * of_a) - far, y), "wrong", 3)
    drawing.texts("""
        459 143 ink *b*² − 4*ac*₀
        459 107 ink rounding
    """)


def triangle(drawing: Drawing) -> None:
    """Areas over the whole; points one rounding apart beside a shared edge."""
    drawing.heads("ratios of areas", "who has the edge?", wrong=[1])
    v0, v1, v2 = np.array([28.0, 38.0]), np.array([268.0, 60.0]), np.array([120.0, 238.0])
    u, v = 0.36, 0.30
    p = v0 + u * (v1 - v0) + v * (v2 - v0)
    for kind, a, b in (("light", v0, v1), ("eye", v2, v0), ("normal", v1, v2)):
        drawing.area(a, b, p, kind=f"{kind} f")
        drawing.line(a, p, kind="edge thin")
    drawing.area(v0, v1, v2, kind="edge")
    drawing.dot(p)
    drawing.texts("20 14 ink *v*₀ \n 274 36 ink *v*₁ \n 118 246 ink *v*₂")
    drawing.texts("148 62 light *v* \n 96 118 eye *u* \n 236 162 normal 1−*u*−*v*")
    # After Kettner and others (2008): on which side of an edge are points around it, a rounding
    # apart?  Each triangle has the edge's ends in its own order.
    n, q, r = 24, np.array([-0.1, 1.5]), np.array([17.1, -13.6])
    steps = np.spacing(0.5) * np.arange(-n // 2, n // 2)
    x, y = np.meshgrid(0.75 + steps, 0.753779069767442 + steps)

    def beside(a: FloatArray, b: FloatArray) -> npt.NDArray[np.bool_]:
        return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) >= 0

    above, below, view = beside(q, r), beside(r, q), drawing.view((384, 48), 8.5)
    for has, colour in (
        (above & ~below, "#c5dcee"),
        (below & ~above, "#f3e6c8"),
        (above & below, "#aab7bb"),
        (~above & ~below, "#bd3a0f"),
    ):
        view.cells(np.argwhere(has)[:, ::-1], colour)
    view.box((0, 0), (n, n), "edge")
    drawing.texts("""
        511 200 eye triangle *A*
        438 80 light *B*
        550 132 ink both
        342 196 wrong neither
        450 18 ink one cell is one rounding
    """)


def box_polygon(drawing: Drawing) -> None:
    """Intervals of slabs and what they share; a line through a vertex."""
    drawing.heads("between both pairs", "a line through a corner", wrong=[1])
    low, high = np.array([105.0, 142.0]), np.array([230.0, 212.0])
    drawing.box((35, low[1]), (290, high[1]), "light f")
    drawing.box((low[0], 102), (high[0], 257), "eye f")
    drawing.box(low, high, "edge")
    o, d = np.array([15.0, 108.0]), unit((1.0, 0.46))
    t = np.stack([(low - o) / d, (high - o) / d])
    both = np.array([t[0].max(), t[1].min()])
    drawing.arrow(o, o + d * 296, "ink")
    spans = {"*x*": ("eye", t[:, 0]), "*y*": ("light", t[:, 1]), "both": ("ink", both)}
    for kind, ends in spans.values():
        for each in ends:
            drawing.ring(o + each * d, kind)
    drawing.bars(10, 79, [(k, kind, [o[0] + e * d[0]]) for k, (kind, e) in spans.items()])
    for each, words, by in ((both[0], "near", (-34, 8)), (both[1], "far", (-20, 12))):
        drawing.text(o + each * d, words, by=by)
    view, corners = drawing.view((420, 162), 92), polar(np.arange(0, 360, 90))
    view.area(*corners)
    view.arrow((0, 0), (1.75, 0), "eye")
    view.dot((0, 0), "eye", 6)
    view.cross(corners[0])
    drawing.texts("""
        450 40 wrong 2 edges end here: outside
        450 14 eye half-open, 1 counts: inside
    """)


def quadric(drawing: Drawing) -> None:
    """Two crossings, one, and the normal of what was stretched."""
    drawing.heads("*f* along a ray", "stretched normals", wrong=[1])
    view, half = drawing.view((88, 125)), np.array([66.0, 42.0])
    view.area(*polar(np.arange(0, 360, 6)) * half)
    o, d = np.array([-82.0, 62.0]), unit((1.0, -0.62))
    A, B, C = d**2 @ half**-2, 2 * o * d @ half**-2, o**2 @ half**-2 - 1
    first, last = (o + (-B + s * math.sqrt(B * B - 4 * A * C)) / (2 * A) * d for s in (-1, 1))
    n = unit(first / half**2)
    view.arrow(o, o + 1.25 * (last - o), "eye")
    view.arrow(first, first + 44 * n, "normal")
    view.dot(first, "eye", 6)
    view.ring(last)
    view.text(first + 44 * n, "∇*f*", "normal", by=(26, 2))
    view.text((-14, -22), "*f* < 0")
    # y = k x², whose axis the ray follows
    view, xs, k, x = drawing.view((234, 64)), np.linspace(-54, 54, 37), 0.052, 20.0
    view.area(*np.stack([xs, k * xs**2], axis=-1))
    view.arrow((x, 185), (x, -28), "eye")
    view.dot((x, k * x * x), "eye", 6)
    stretch, q = np.diag([2.0, 0.9]), polar(55.0)
    p, along = stretch @ q, unit(stretch @ (-q[1], q[0]))
    right, wrong = unit(np.linalg.inv(stretch).T @ q), unit(stretch @ q)
    view = drawing.view((350, 105), 36)
    view.circle((0, 0), 1)
    view.arrow(q, 2.2 * q, "normal")
    view.dot(q)
    view.text(2.2 * q, "*n*", "normal", by=(-12, 4))
    view = drawing.view((478, 105), 36)
    view.area(*polar(np.arange(0, 360, 6)) @ stretch)
    view.line(p - along, p + along, kind="guide")
    view.arrow(p, p + 1.7 * right, "normal")
    view.arrow(p, p + 1.7 * wrong, "wrong")
    view.cross(p + 0.85 * wrong)
    view.dot(p)
    view.text(p + 1.7 * right, "*A*⁻ᵀ*n*", "normal", by=(-34, 6))
    view.text(p + 1.7 * wrong, "*A n*", "wrong", by=(0, 12))
    drawing.texts("88 14 ink two roots \n 234 14 ink one root")
    drawing.texts("350 14 ink circle \n 480 14 ink twice as wide")


def csg(drawing: Drawing) -> None:
    """Intervals along a ray and what set operations make of them; faces in one place."""
    drawing.heads("inside, along a ray", "faces that coincide", wrong=[1])
    A, B = ball(150, 202, 50), ball(219, 206, 50)
    for each, kind in ((A, "eye"), (B, "light")):
        drawing.circle(each.center, each.radius, f"{kind} f")
        drawing.circle(each.center, each.radius, kind)
    drawing.arrow((53, 198), (292, 198), "ink")
    a, b = (crossings((0, 198), (1, 0), each) for each in (A, B))
    for t in (*a, *b):
        drawing.ring((t, 198))
    drawing.bars(
        10,
        128,
        (
            ("*A*", "eye", [a]),
            ("*B*", "light", [b]),
            ("*A* ∪ *B*", "ink", [(a[0], b[1])]),
            ("*A* ∩ *B*", "ink", [(b[0], a[1])]),
            (r"*A* \ *B*", "ink", [(a[0], b[0])]),
        ),
    )
    left, film, half, right = 400, 414, 475, 550
    for low, high, kind in ((left, right, "eye"), (film, half, "light")):
        drawing.box((low, 125), (high, 215), f"{kind} f")
        drawing.box((low, 125), (high, 215), kind)
    drawing.arrow((322, 170), (590, 170), "ink")
    drawing.cross(((left + film) / 2, 170))
    drawing.bars(
        316,
        99,
        (
            ("*A*", "eye", [(left, right)]),
            ("*B*", "light", [(film, half)]),
            (r"*A* \ *B*", "wrong", [(left, film), (half, right)]),
        ),
    )
    drawing.texts("""
        130 214 eye *A*
        243 214 light *B*
        445 184 light *B*
        515 184 eye *A*
        450 10 wrong 0.3 ≠ 0.1 + 0.2
    """)


def cameras(drawing: Drawing) -> None:
    """What the pixels see of a ball nearby and of one as large further away."""
    drawing.heads("orthographic", "perspective", "hole of a size", wrong=[2])
    balls = (ball(112, 46, 24), "eye"), (ball(158, -40, 24), "light")
    n, hole, radius, far = 12, np.array([52.0, 0.0]), 9.0, 160.0
    film = np.stack([np.zeros(n), 13.0 * (np.arange(n) - n / 2 + 0.5)], axis=-1)
    for at, size, on, origin, towards in (
        (12, 13.0, film, film, film * 0 + (1, 0)),
        (210, 6.5, film / 2 + (44, 0), film * 0, film / 2 + (44, 0)),
        (414, 9.1, film * 0.7, film * 0.7, hole - film * 0.7),
    ):
        view = drawing.view((at, 150))
        for each, kind in balls:
            view.circle(each.center, each.radius, f"{kind} f")
            view.circle(each.center, each.radius, kind)
        half = np.array([3, size / 2])
        for pixel, o, d in zip(on, origin, towards, strict=True):
            hits = ((crossings(o, unit(d), each), kind) for each, kind in balls)
            t, kind = min([(t[0], kind) for t, kind in hits if len(t)], default=(0.0, "edge"))
            if t:
                view.line(o, o + t * unit(d), kind=f"{kind} thin")
            view.box(pixel - half, pixel + half, f"{kind} s")
    p = film[-4] * 0.7
    rims = [hole - (0, s) for s in (radius, -radius)]
    ends = [p + (rim - p) * far / hole[0] for rim in rims]
    view.area(p, *ends, kind="wrong f")
    for rim, end in zip(rims, ends, strict=True):
        view.line(p, end, kind="wrong thin")
        view.line(rim, (rim[0], math.copysign(74, rim[1])), kind="edge")
    drawing.dot((210, 150))
    drawing.texts("""
        222 172 ink *e*
        100 18 ink one size
        300 18 ink further, smaller
        500 18 wrong *r* (1 + *z*/*d*)
    """)


def rasterising(drawing: Drawing) -> None:
    """Pixels whose middle is inside; barycentrics that are linear on the film."""
    drawing.heads("middles inside", "linear on the film", wrong=[1])
    view, width, height = drawing.view((18, 24), 22), 12, 10
    a, b, c = np.array([0.6, 1.3]), np.array([11.5, 3.6]), np.array([4.2, 9.4])
    middles = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1) + 0.5

    def side(p: FloatArray, q: FloatArray) -> FloatArray:
        u, v = q - p, middles - p
        return u[0] * v[..., 1] - u[1] * v[..., 0]

    inside = (side(a, b) >= 0) & (side(b, c) >= 0) & (side(c, a) >= 0)
    view.cells(middles[inside] - 0.5, "#c5dcee")
    for k in range(width + 1):
        view.line((k, 0), (k, height), kind="grid")
    for k in range(height + 1):
        view.line((0, k), (width, k), kind="grid")
    view.area(a, b, c, kind="edge")
    for middle, full in zip(middles.reshape(-1, 2), inside.flat, strict=True):
        view.dot(middle, *(("eye", 3.2) if full else ("guide", 2.0)))

    def seen(u: float, v: float) -> FloatArray:
        """A square floor from depth 1 to 3."""
        return np.array([u - 0.5, -1.7]) / (1 + 2 * v)

    p, q, r, s = corners = [seen(0, 0), seen(1, 0), seen(1, 1), seen(0, 1)]

    def linear(u: float, v: float) -> FloatArray:
        """On the triangles on both sides of the diagonal u = v."""
        return p + u * (q - p) + v * (r - q) if u > v else p + v * (s - p) + u * (r - s)

    for x, place, kind in ((376, seen, "eye"), (524, linear, "wrong")):
        view = drawing.view((x, 300), 138)
        for k in np.linspace(0, 1, 7):
            view.line(place(k, 0), place(k, k), place(k, 1), kind=f"{kind} thin")
            view.line(place(0, k), place(k, k), place(1, k), kind=f"{kind} thin")
        view.area(*corners, kind=kind)
        view.line(p, r, kind="guide")
    drawing.texts("376 28 eye 1/*z* linear \n 524 28 wrong *u*, *v* linear")


def precision(drawing: Drawing) -> None:
    """A point below its own surface, an offset that is too large, one that is a bound."""
    drawing.heads("no offset", "too large", "a bound", wrong=[0, 1])
    grid, top, bound, lamp = 26.0, 248.0, 24.0, np.array([66.0, 370.0])
    exact = polar(101.0, top)
    rounded, n = np.round(exact / grid) * grid, unit(exact)
    for x in (100, 500):
        view = drawing.view((x, 54), 1, (0, 190))
        view.area(*polar(np.linspace(112, 68, 23), top), (92, 198), (-92, 198))
        for k in np.ndindex(7, 7):
            view.dot(np.add(k, (-3, 8)) * grid, "guide", 2)
        view.arrow(exact - (36, -112), exact, "eye")
        start = rounded
        if x == 500:
            start = rounded + bound * n
            view.circle(rounded, bound, "normal f")
            view.arrow(rounded, start, "normal", 9)
        view.arrow(start, lamp, "shadow", short=13)
        view.circle(lamp, 10, "lamp")
        for t in crossings(start, lamp - start, ball(0, 0, top)):
            view.cross(start + t * (lamp - start))
        view.dot(rounded)
    drawing.box((208, 62), (392, 84))
    drawing.box((208, 122), (392, 130), "dark")
    drawing.arrow((270, 84), (270, 162), "wrong")
    drawing.arrow((270, 162), (366, 234), "shadow", short=13)
    drawing.circle((366, 234), 10, "lamp")
    drawing.cross((270, 126))
    drawing.dot((270, 84))
    drawing.texts("""
        252 146 wrong *ε*
        336 98 ink thin gap
        100 18 wrong hits itself
        300 18 wrong passes a wall
        500 18 normal starts at *p* + *e n*
    """)


def bvh(drawing: Drawing) -> None:
    """Boxes that a ray enters, those that it skips; and a leaf that is not the last word."""
    drawing.heads("entered, skipped", "a leaf is no last word", wrong=[1])
    rng, grid = np.random.default_rng(5), np.stack(np.meshgrid(np.arange(5), np.arange(4)), axis=-1)
    centres = grid.reshape(-1, 2) * 54.0 + (40, 38) + rng.uniform(-9, 9, (grid.size // 2, 2))
    radii = rng.uniform(8, 17, len(centres))
    o, d, tests = np.array([10.0, 186.0]), unit((1.0, -0.28)), [0, 0]

    def visit(items: npt.NDArray[np.int64], pad: float, entered: bool) -> None:
        low = (centres[items] - radii[items, None]).min(axis=0) - pad
        high = (centres[items] + radii[items, None]).max(axis=0) + pad
        t = np.sort([(low - o) / d, (high - o) / d], axis=0)
        met = entered and bool(t[0].max() <= t[1].min())
        tests[0] += entered
        if len(items) > 3:
            drawing.box(low, high, "eye thin" if met else "guide")
            order = items[np.argsort(centres[items, np.argmax(high - low)])]
            for half in np.array_split(order, 2):
                visit(half, pad - 3, met)
            return
        tests[1] += met * len(items)
        for kind in ("eye f", "eye thin") if met else ("guide",):
            drawing.box(low, high, kind)
        for k in items:
            drawing.circle(centres[k], radii[k], "dark" if met else "shape")

    visit(np.arange(len(centres)), 10.0, True)
    drawing.arrow(o, o + 280 * d, "eye")
    words = f"{tests[0]} boxes, {tests[1]} of {len(centres)} balls"
    drawing.text((150, 246), words, "eye")
    y = 140
    drawing.arrow((308, y), (588, y), "eye")
    for low, high, kind, balls in (
        ((332, 110), (574, 212), "wrong", (ball(358, 186, 18), ball(540, 144, 26))),
        ((426, 54), (502, 166), "eye", (ball(454, 136, 22), ball(478, 78, 16))),
    ):
        drawing.box(low, high, kind)
        for each in balls:
            drawing.circle(each.center, each.radius)
        hit = (crossings((0, y), (1, 0), *balls)[0], y)
        if kind == "wrong":
            drawing.cross(hit)
        else:
            drawing.dot(hit, kind)
    drawing.texts("453 224 wrong first box: stop here? \n 464 28 eye second box: nearer")
