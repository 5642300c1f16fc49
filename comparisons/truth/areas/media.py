"""Media: what they take from light, and what they leave alone.

sigma_t t is the optical distance of a way t; the share exp(-sigma_t t) of the light arrives (Beer
1852)."""

import numpy as np
from scipy.special import expn

from comparisons.truth.case import Expected, FloatArray, case
from comparisons.truth.film import View, pixel_means, seen_from_above
from comparisons.truth.optics import fresnel
from comparisons.truth.scattering import left

SKY = np.array([0.5, 1.0, 2.0])
RHO = np.array([0.8, 0.5, 0.2])
LAMP = np.array([3.0, 2.0, 1.0])
SMOKE = np.array([0.6, 1.2, 2.4])
WIDTH = 2.4
HALF = float(np.tan(np.radians(25.0)))
VIEW = View((0, 0, 1), (0, 1.2, 0), (0, 0, 1), (HALF, HALF), (32, 32))
BEER = "Beer's law"


def _down(x: FloatArray, y: FloatArray) -> FloatArray:
    """Cosines to the vertical of rays of the usual slanting view, of 15 to 65 degrees."""
    return np.abs(VIEW.rays(x, y)[..., 2])


def _uniform(value: FloatArray) -> Expected:
    return Expected(np.broadcast_to(value, (32, 32, 3)).copy())


# ---- media that absorb --------------------------------------------------------------------------


@case(r"$L \exp(-\frac{\sigma_t h}{\cos\theta})$", "a layer that absorbs", BEER)
def smoke_slab(sigma: FloatArray = SMOKE) -> Expected:
    """The way of a ray through a layer is its thickness over the cosine.  The layer is behind its
    upper boundary, and in front of its lower one."""
    return Expected(pixel_means(lambda x, y: SKY * left(_down(x, y), 0.5 * sigma), 32, 32))


def _chord(x: FloatArray, y: FloatArray, radius: float) -> FloatArray:
    """Of a ball's ways along z, at (x, y) from its centre; 0 outside."""
    return np.asarray(2.0 * np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0.0)))


def _away(x: FloatArray, y: FloatArray, radius: float) -> FloatArray:
    """1 where a ball's rim is far enough that Gauss's rule sees no root there, NaN elsewhere."""
    r = np.hypot(x, y) / radius
    return np.where((r > 0.9) & (r < 1.0), np.nan, 1.0)


@case(r"$L \exp(-2 \sigma_t \sqrt{R^2 - r^2})$", "a ball that absorbs", BEER)
def smoke_ball() -> Expected:
    """The way through a ball is its chord, at the distance r from the centre.  Pixels at the rim,
    where the chord falls like a root, are not stated."""

    def seen(x: FloatArray, y: FloatArray) -> FloatArray:
        way = _chord(x, y, 1.0) * _away(x, y, 1.0)
        return np.asarray(SKY * np.exp(-SMOKE * way[..., None]))

    return Expected(seen_from_above(seen, WIDTH, 32, 8), 1e-9)


def _turn(axis: int, degrees: float) -> FloatArray:
    """The matrix of a rotation about a coordinate axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, -s, s, c
    return matrix


@case(r"$L \exp(-\sigma_t t)$, $t$ the way through a box", "a turned box that absorbs", BEER)
def smoke_box() -> Expected:
    """A ray is in the box while it is between all three pairs of planes.  Pixels in which it comes
    in or goes out by different faces are not stated."""
    half = np.array([0.8, 0.5, 0.6])
    to_box = (_turn(1, 25.0) @ _turn(0, 35.0)).T
    along = to_box @ np.array([0.0, 0.0, -1.0])

    def seen(x: FloatArray, y: FloatArray) -> FloatArray:
        start = np.stack([x, y, np.full_like(x, 3.0)], axis=-1) @ to_box.T
        ends = np.sort(np.stack([(-half - start) / along, (half - start) / along]), axis=0)
        t = ends[1].min(axis=-1) - ends[0].max(axis=-1)
        face = np.where(t > 0.0, 3 * ends[0].argmax(axis=-1) + ends[1].argmin(axis=-1), -1)
        faces = face.reshape(32, order, 32, order)
        one = (faces == faces[:, :1, :, :1]).all(axis=(1, 3), keepdims=True)
        way = np.where(np.broadcast_to(one, faces.shape).reshape(t.shape), np.maximum(t, 0), np.nan)
        return np.asarray(SKY * np.exp(-SMOKE * way[..., None]))

    order = len(np.polynomial.legendre.leggauss(12)[0])
    # An edge can cross the corner of a pixel between nodes: 1 % of a side at most, where the way
    # changes by as little.
    return Expected(seen_from_above(seen, WIDTH, 32, 12), 1e-5)


@case(
    r"$L \exp(-\frac{\sum_k \sigma_k h_k}{\cos\theta})$", "three media with boundaries in common",
    BEER,
)  # fmt: skip
def smoke_in_row() -> Expected:
    """Each layer takes its share of what the others leave."""
    layers = (([2.0, 0.2, 0.1], 0.3), ([0.1, 2.5, 0.3], 0.2), ([0.2, 0.1, 1.5], 0.5))
    depth = sum(np.array(sigma) * h for sigma, h in layers)
    return Expected(pixel_means(lambda x, y: SKY * left(_down(x, y), depth), 32, 32))


@case(
    r"$L \exp(-\sigma_1 (t_1 - t_2) - \sigma_2 t_2)$, $t$ the chords", "a medium in a medium", BEER
)
def smoke_in_smoke() -> Expected:
    """In the inner ball, which is not in the middle, the inner medium is in place of the outer one.
    Pixels at the rims are not stated."""
    inner = np.array([3.0, 0.3, 0.9])

    def seen(x: FloatArray, y: FloatArray) -> FloatArray:
        u, v = x - 0.2, y - 0.1
        t1 = (_chord(x, y, 1.0) * _away(x, y, 1.0))[..., None]
        t2 = (_chord(u, v, 0.5) * _away(u, v, 0.5))[..., None]
        return np.asarray(SKY * np.exp(-SMOKE * (t1 - t2) - inner * t2))

    return Expected(seen_from_above(seen, WIDTH, 32, 8), 1e-8)


@case(r"$L \exp(-\frac{\sigma_t h}{\cos\theta})$", "a camera within a medium", BEER)
def lamp_through_smoke() -> Expected:
    """The camera and the shining floor are in one medium, which nothing bounds."""
    return Expected(pixel_means(lambda x, y: LAMP * left(_down(x, y), SMOKE), 32, 32))


@case(
    r"$\frac{\rho I h}{\pi d^3} \exp(-\sigma_t (d + v))$", "a shadow ray within a medium", BEER
)  # fmt: skip
def floor_in_smoke() -> Expected:
    """As `point_over_floor`; the light goes d from the lamp to the floor, and v from there to the
    camera, whose rays are parallel."""

    def seen(x: FloatArray, y: FloatArray) -> FloatArray:
        d = np.sqrt((x - 0.5) ** 2 + (y - 0.3) ** 2 + 1.0)[..., None]
        return np.asarray(np.array([10.0, 6.0, 2.0]) / d**3 * np.exp(-SMOKE * (d + 0.7)))

    return Expected(seen_from_above(seen, 4.0, 32) * RHO / np.pi)


@case(
    r"$\frac{\rho L h^2}{\pi} \int \frac{\exp(-\sigma_t (d + v))}{d^4} dA$ over the lamp",
    "the light of a lamp within a medium", BEER,
)  # fmt: skip
def lamp_in_smoke() -> Expected:
    """A level square lamp; v as in `floor_in_smoke`.  Gauss's rule over the lamp."""
    node, weight = np.polynomial.legendre.leggauss(10)
    a, b = np.meshgrid(node / 2.0, node / 2.0)
    area = np.outer(weight, weight) / 4.0

    def seen(x: FloatArray, y: FloatArray) -> FloatArray:
        d2 = (x[..., None, None] - a) ** 2 + (y[..., None, None] - b) ** 2 + 1.0
        way, share = np.sqrt(d2) + 0.1, area / d2**2
        parts = [(np.exp(-sigma * way) * share).sum(axis=(-2, -1)) for sigma in SMOKE]
        return np.stack(parts, axis=-1)

    return Expected(seen_from_above(seen, 3.0, 16, 4) * RHO * LAMP / np.pi)


@case(
    r"$2 \rho L E_3(\sigma_t h) \exp(-\frac{\sigma_t h}{\cos\theta})$",
    "a floor below a layer that absorbs", "Chandrasekhar 1960, appendix I",
)  # fmt: skip
def floor_under_smoke() -> Expected:
    """Of a sky's radiance L, exp(-sigma_t h / mu) arrives at the cosine mu; its irradiance is 2
    pi L times the exponential integral E3.  Shadow rays go through the layer's boundary."""
    depth = 0.5 * SMOKE
    shade = RHO * SKY * 2.0 * expn(3, depth)
    return Expected(pixel_means(lambda x, y: shade * left(_down(x, y), depth), 32, 32))


@case(
    r"$(F + \frac{(1 - F)^2 T}{1 - F T}) L$, $T = \exp(-2 \sigma_t R \cos\theta_t)$",
    "a ball of coloured glass", "Fresnel's equations; Beer's law",
)  # fmt: skip
def ink_in_glass() -> Expected:
    """Within a ball all chords of a path are alike, and so are all angles: each leaves T, and the
    glass F of it for the next one.  The index squared cancels."""

    def seen(x: FloatArray, y: FloatArray) -> FloatArray:
        r2 = x * x + y * y
        inner = np.minimum(r2, 0.81)
        f = fresnel(np.sqrt(1.0 - inner), 1.5)[..., None]
        t = np.exp(-2.0 * SMOKE * np.sqrt(1.0 - inner / 2.25)[..., None])
        value = f + (1.0 - f) ** 2 * t / (1.0 - f * t)
        rest = np.where(r2 > 1.0, 1.0, np.nan)[..., None]
        return np.asarray(SKY * np.where(r2[..., None] < 0.81, value, rest))

    return Expected(seen_from_above(seen, WIDTH, 32, 8), 1e-9)


@case(
    r"$R L + \frac{(1 - F)^2 T}{1 - F^2 T^2} L_{lamp}$, "
    r"$R = F + \frac{(1 - F)^2 F T^2}{1 - F^2 T^2}$",
    "a slab of coloured glass", "Fresnel's equations; Beer's law",
)  # fmt: skip
def stained_slab() -> Expected:
    """As `slab`: each crossing of the glass leaves T = exp(-sigma_t h / cos theta_t)."""

    def seen(x: FloatArray, y: FloatArray) -> FloatArray:
        c = _down(x, y)
        f = fresnel(c, 1.5)[..., None]
        t = left(np.sqrt(1.0 - (1.0 - c * c) / 2.25), 0.5 * SMOKE)
        common = (1.0 - f) ** 2 * t / (1.0 - f * f * t * t)
        return np.asarray((f + common * f * t) * SKY + common * LAMP)

    return Expected(pixel_means(seen, 32, 32, 8), 1e-9)


# ---- media that take nothing --------------------------------------------------------------------


@case("$L$", "media of albedo 1, one in another, lose no light")
def white_fog() -> Expected:
    """Where the radiance is the same from everywhere, a medium scatters into each direction as much
    as out of it: the fog cannot be seen, whatever its phase function and density."""
    return _uniform(SKY)


@case("$L$", "a medium of albedo 1 in glass loses no light")
def milk_in_glass() -> Expected:
    """As `white_fog`, and `glass_furnace`: within the glass the radiance is eta^2 L everywhere."""
    return _uniform(SKY)


@case(r"$\frac{L}{1 - \rho}$", "a medium of albedo 1 fills a closed room")
def foggy_room() -> Expected:
    """As `closed_room`: the radiance is the same from everywhere, and the fog changes nothing."""
    return _uniform(np.array([0.3, 0.5, 1.0]) / (1.0 - RHO))
