"""Ways through media: what is left of light, and how far light flies."""

import math
from typing import Any, NamedTuple

import numpy as np
from flint import arb

import reference_rt as rt
from comparisons.experiments.stability.harness.exactly import exactly
from comparisons.experiments.stability.harness.outcomes import (
    MITSUBA,
    OURS,
    FloatArray,
    Outcome,
    Outcomes,
    U,
    of_errors,
    outcome,
    plain,
    relative,
    unit_of,
)
from comparisons.experiments.stability.harness.series import Draw, Sweep, decades, series
from comparisons.experiments.stability.harness.steps import at, scaled
from comparisons.experiments.stability.harness.worlds import grey
from comparisons.geometry.frame import round32
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.scene import for_rays
from reference_rt.core.ray import SURFACE_ROUNDING, Ray
from reference_rt.core.vec3 import row
from reference_rt.integrators.media_path import fly
from reference_rt.integrators.scene_tables import KernelScene
from reference_rt.jit.kernel import entry_kernel
from reference_rt.media import Media
from reference_rt.rendering.kept_links import link_to_scene
from reference_rt.scene.build_media import media_of

TEXTBOOK = "flight.logarithm"
"""-log(1 - u) / sigma_t: 1 - u rounds."""

# ---- absorption ---------------------------------------------------------------------------------


class Layer(NamedTuple):
    """A medium between two level planes.  top, bottom: their heights;  size: half of their edges;
    middle: x and y of their middle."""

    sigma: float
    top: float
    bottom: float
    size: float
    middle: float
    albedo: float = 0.0

    def scene(self) -> rt.Scene:
        """Under a sky of radiance 1."""
        planes: Any = (self.top, {"interior": "smoke"}), (self.bottom, {"exterior": "smoke"})
        return rt.Scene(
            media={"smoke": rt.Homogeneous(sigma_t=grey(self.sigma), albedo=grey(self.albedo))},
            materials={"edge": rt.NoSurface()},
            shapes=tuple(
                rt.Rectangle(
                    material="edge",
                    transform=(scaled(self.size), at(self.middle, self.middle, z)),
                    **side,
                )
                for z, side in planes
            ),
            lights=(rt.Constant(radiance=grey(1.0)),),
            integrator=rt.Path(),
        )

    @property
    def reach(self) -> float:
        """The largest number that the error bound of a plane is made of."""
        return 2.0 * (self.middle + abs(self.top) + self.size)


def _steep(rng: np.random.Generator, n: int) -> FloatArray:
    """Unit directions (n, 3) downwards, of cosines from 0.2 to 1."""
    cosine, phi = rng.uniform(0.2, 1.0, n), rng.uniform(0.0, 2.0 * math.pi, n)
    sine = np.sqrt(1.0 - cosine**2)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), -cosine], axis=1)


def _exact_ways(layer: Layer, d: FloatArray) -> FloatArray:
    """(n, 2): the ways through a layer along d, and what they leave of light."""
    height = arb(layer.top) - arb(layer.bottom)

    def formula(v: list[arb]) -> tuple[arb, arb]:
        way = height * (v[0] ** 2 + v[1] ** 2 + v[2] ** 2).sqrt() / abs(v[2])
        return way, (-arb(layer.sigma) * way).exp()

    return exactly(formula, d)


def _absorbed(layer: Layer, draw: Draw, takes_part: bool) -> Outcomes:
    """takes_part: whether Mitsuba's medium is given the exact ways."""
    n = draw.cases
    d = round32(_steep(draw.rng, n))
    # From right above the middle, so that no ray leaves the planes.
    o = np.full((n, 3), layer.middle)
    o[:, 2] = layer.top + 0.05 * layer.size
    way, left = _exact_ways(layer, d).T
    values = {OURS: layer.scene().radiance(o, d, spp=1).mean[:, 0]}
    if draw.mitsuba and takes_part:
        values[MITSUBA] = _theirs_left(layer.sigma, round32(way))
    found = {}
    for name, value in values.items():
        unit = unit_of(name)
        placed = 2.0 * SURFACE_ROUNDING * layer.reach / np.abs(d[:, 2]) if name == OURS else 0.0
        allowed = 16.0 * unit + layer.sigma * (4.0 * unit * way + placed)
        # Where floats of this exponent have lost digits, nothing is left that could be seen.
        least = 1e-290 if name == OURS else 1e-30
        errors = np.where(left > least, relative(value, left), np.where(value > 2 * least, 1.0, 0))
        shown = {"sigma_t": layer.sigma, "top": layer.top, "bottom": layer.bottom, "direction": d}
        shown |= {"left": plain(left), "found": plain(value)}
        found[name] = of_errors(errors / np.minimum(allowed, 1.0), 1.0, shown)
    return found


def _theirs_left(sigma: float, way: FloatArray) -> FloatArray:
    """Mitsuba's transmittance of ways (n,) in a medium: exp(-sigma_t t)."""
    import drjit as dr

    mi = mitsuba()
    medium = _their_medium(sigma)

    def left(t: Any) -> tuple[Any, ...]:
        there = dr.zeros(mi.MediumInteraction3f)
        there.t, there.mint = math.inf, 0.0
        there.combined_extinction = medium.get_majorant(there)
        there.sigma_t = there.combined_extinction
        end = dr.zeros(mi.SurfaceInteraction3f)
        end.t = t
        return (medium.transmittance_eval_pdf(there, end, True)[0].x,)

    return for_rays(left, way)[0]


def _their_medium(sigma: float) -> Any:
    return mitsuba().load_dict(
        {"type": "homogeneous", "albedo": 0.5, "sigma_t": 1.0, "scale": sigma}
    )


DEPTHS = (*decades(-8, 2), 6e2)


@series(
    Sweep("optical depth", DEPTHS, (1e-8, 1.0, 6e2), 1_000, 20_000),
    unit="of what is allowed",
    explained="an exponential of a product: Mitsuba's medium, which is given the exact ways, is "
    "right to its own u at every depth",
)
def optical_depth(draw: Draw, x: float) -> Outcomes:
    """Rays through a layer of the optical depth x, of any thickness from 1e-3 to 1e3: what they
    leave of light against exp in 300 bits."""
    height = 10.0 ** draw.rng.uniform(-3.0, 3.0)
    sigma = float(round32(np.array(x / height)))
    layer = Layer(sigma, 0.25 * height, -0.75 * height, 16.0 * height, 0.0)
    return _absorbed(layer, draw, takes_part=True)


@series(
    Sweep("coordinates / thickness", decades(0, 10), (1.0, 1e5, 1e10), 1_000, 20_000),
    unit="of what is allowed",
)
def thin_layers(draw: Draw, x: float) -> Outcomes:
    """Rays through a layer of the optical depth 1 whose thickness is 1 / x of the size of its
    planes."""
    return _absorbed(Layer(x, 0.5 / x, -0.5 / x, 16.0, 0.0), draw, takes_part=False)


@series(
    Sweep("offset / thickness", decades(0, 12), (1.0, 1e6, 1e12), 1_000, 20_000),
    unit="of what is allowed",
)
def far_away(draw: Draw, x: float) -> Outcomes:
    """Rays through a layer of the thickness and the optical depth 1, x away from the origin along
    each axis."""
    return _absorbed(Layer(1.0, x, x - 1.0, 16.0, x), draw, takes_part=False)


# ---- flights ------------------------------------------------------------------------------------


@entry_kernel
def _flights(scene: KernelScene, media: Media, d: Any, medium: int, u: Any, out: Any) -> None:
    for i in range(len(u)):
        ray = Ray(row(d, 0), row(d, 1), math.inf)
        found = fly(scene, media, ray, medium, 0, u[i], False)
        out[i, 0] = 1.0 if found.is_scattered else 0.0
        out[i, 1] = -found.point.p.z


def _flown(scene: rt.Scene, u: FloatArray) -> FloatArray:
    """(n, 2): of flights down from the origin, in the first medium: whether they scatter in it, and
    how far away they end."""
    found, out = link_to_scene(scene.tables, fly), np.empty((len(u), 2))
    ray = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    _flights(found.tables, media_of(scene), ray, 0, u.copy(), out)
    return out


def _numbers(rng: np.random.Generator, n: int, x: float) -> FloatArray:
    """From [0, 1): in turn near 1 / x and near 1 - 1 / x."""
    near = rng.uniform(0.5, 1.0, n) / x
    return np.where(np.arange(n) % 2 == 0, near, np.minimum(1.0 - near, 1.0 - U))


@series(
    Sweep(
        "1 / number, or 1 / (1 - number)", (2.0, *decades(1, 16)), (2.0, 1e8, 1e16), 1_000, 20_000
    ),
    unit="of the distance",
)
def flights(draw: Draw, x: float) -> Outcomes:
    """Distances in an endless medium that numbers near 0 and near 1 draw, against ln in 300
    bits."""
    sigma = float(round32(np.array(10.0 ** draw.rng.uniform(-3.0, 3.0))))
    u = _numbers(draw.rng, draw.cases, x)
    single = np.minimum(round32(u), 1.0 - 2.0**-24)
    scene = Layer(sigma, 1.0, -1e30, 1.0, 0.0, 0.5).scene()
    found = {OURS: (u, _flown(scene, u)[:, 1])}
    with np.errstate(divide="ignore"):
        found[TEXTBOOK] = u, -np.log(1.0 - u) / sigma
    if draw.mitsuba:
        found[MITSUBA] = single, _their_flights(sigma, single)
    outcomes = {}
    for who, (given, distance) in found.items():
        exact = exactly(lambda v: -(1 - v).log() / arb(sigma), given)
        shown = {
            "sigma_t": sigma,
            "number": given,
            "distance": plain(exact),
            "found": plain(distance),
        }
        outcomes[who] = of_errors(relative(distance, exact), 4.0 * unit_of(who), shown)
    return outcomes


def _their_flights(sigma: float, u: FloatArray) -> FloatArray:
    mi = mitsuba()
    medium, ray = _their_medium(sigma), mi.Ray3f(mi.Point3f(0, 0, 0), mi.Vector3f(0, 0, 1))
    found = for_rays(lambda v: (medium.sample_interaction(ray, v, mi.UInt32(0), True).t,), u)
    return found[0]


THIN = (0.04, 0.1, 0.3, 1.0, *decades(1, 15))


@series(
    Sweep("1 / optical depth", THIN, (0.04, 1.0, 1e8, 1e15), 1_000, 20_000),
)
def scattering_in_layers(draw: Draw, x: float) -> Outcomes:
    """Flights into a layer of the optical depth 1 / x by the numbers right below and right above
    1 - exp(-1 / x): the first ones scatter in it, the others do not."""
    height = 10.0 ** draw.rng.uniform(-3.0, 3.0)
    layer = Layer(1.0 / (x * height), 1.0 * height, -height, 16.0 * height, 0.0, 0.5)
    depth = arb(layer.sigma) * arb(height)
    inside = np.arange(draw.cases) % 2 == 0
    # Further away than rounding explains, by up to a thousand times that.
    beside = 16.0 * U * 10.0 ** draw.rng.uniform(0.0, 3.0, draw.cases)
    near = np.where(inside, 1.0 - beside, 1.0 + beside)
    u = exactly(lambda v: 1 - (-depth * v).exp(), near)
    # Rounding 1 - exp(-tau) to a float must not cross the threshold.
    u = np.nextafter(np.nextafter(u, np.where(inside, 0.0, 1.0)), np.where(inside, 0.0, 1.0))
    u = np.minimum(u, 1.0 - U)
    methods = {OURS: _flown(layer.scene(), u)[:, 0] != 0.0}
    with np.errstate(divide="ignore"):
        methods[TEXTBOOK] = -np.log(1.0 - u) / layer.sigma < height
    found: dict[str, Outcome] = {}
    for who, scattered in methods.items():
        shown = {"sigma_t": layer.sigma, "thickness": height, "number": u}
        found[who] = outcome(scattered != inside, shown | {"scatters": plain(scattered)})
    return found
