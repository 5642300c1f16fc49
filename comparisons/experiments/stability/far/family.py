"""F1: far and small quadrics, spheres and tori.

Law.  A ray hits a sphere where the exact discriminant says so, wherever it passes the rim by more
than 5 u of the radius (u = 2^-53; `f01_far_law.BAND` derives it), at any distance D, offset and
size; then |t - exact| |d| <= 16 u (|t| |d| + D) + 5 u r² / h, h half the chord, the last term being
what the band makes of the root.  Of the other kinds the answer is the exact one of a ray that
passes at most 64 u sizes beside (`f01_far_law.MOVED`), t to within 16 u (|t| |d| + D).  A hit is
within this of the surface, and so within the bounding box.

Ranges.  Distance / radius 1e0 to 1e12 (each times 2 to 10; of other kinds 1 to 10, so that rays
begin within their boxes too), the centre's offset 1e0 to 1e12 radii, radius 1e-9 to 1e9, |d| 1e-3
to 1e3 times the distance; half of the rays within 2^-1 to 2^-40 radii of tangency, in `rim` to
2^-53.  Spheres, ellipsoids, open cylinders, cones, paraboloids, capped
hyperboloids of one sheet, tori.

Counts.  1e5 rays a decade for spheres, 2e4 for quadrics, 2e3 for tori, whose arbiter takes 100 µs.

Passes.  No ray outside of the bands breaks the law.  The arbiter is exact: integers times powers of
two, for tori FLINT's certified roots.  The issue's band, 1e-10 radii at a distance of 1e6, is the
first of the powers of ten above u D / r: this holds with 5 u at every distance.

Mitsuba takes part with its scalar variant's spheres, cylinders and instances of spheres, in numbers
that float32 has, judged by the exact answer for these and by the same law in float32's u = 2^-24;
the other kinds are meshes there.
"""

from collections.abc import Callable, Mapping

import numpy as np

from comparisons.experiments.stability.far import curved, spheres
from comparisons.experiments.stability.far.picture import shoot
from comparisons.experiments.stability.harness.family import (
    Draw,
    Family,
    FloatArray,
    Outcome,
    Series,
    decades,
)

Measure = Callable[[Draw, float], Mapping[str, Outcome]]

OF_BOUND = "of the law's bound"


def _from(draw: Draw, x: float, most: float = 1.0, least: float = 2.0) -> FloatArray:
    """Distances of `least` to 10 times x to x `most`, evenly over the decades."""
    low, high = np.log10(least), 1.0 + np.log10(most)
    return np.asarray(x * 10.0 ** draw.rng.uniform(low, high, draw.cases))


def _distance(draw: Draw, x: float) -> Mapping[str, Outcome]:
    gap = spheres.mixed_gaps(draw.rng, draw.cases)
    return spheres.compete(draw, spheres.draw_rays(draw.rng, _from(draw, x), gap))


def _body(draw: Draw, x: float) -> Mapping[str, Outcome]:
    gap = spheres.clear_gaps(draw.rng, draw.cases)
    return spheres.compete(draw, spheres.draw_rays(draw.rng, _from(draw, x), gap))


def _rim(draw: Draw, x: float) -> Mapping[str, Outcome]:
    sides = draw.rng.choice([-1.0, 1.0], draw.cases) * draw.rng.uniform(1.0, 2.0, draw.cases)
    rays = spheres.draw_rays(draw.rng, _from(draw, 1.0, 1e5), sides / x)
    return spheres.compete(draw, rays, strict=True)


def _offset(draw: Draw, x: float) -> Mapping[str, Outcome]:
    gap = spheres.mixed_gaps(draw.rng, draw.cases)
    return spheres.compete(draw, spheres.draw_rays(draw.rng, _from(draw, 1.0, 1e2), gap, offset=x))


def _size(draw: Draw, x: float) -> Mapping[str, Outcome]:
    gap = spheres.mixed_gaps(draw.rng, draw.cases)
    rays = spheres.draw_rays(draw.rng, _from(draw, 1.0, 1e2), gap, radius=x)
    return spheres.compete(draw, rays)


def _of(name: str) -> Measure:
    def measure(draw: Draw, x: float) -> Mapping[str, Outcome]:
        return curved.compete(draw, name, _from(draw, x, least=1.0))

    return measure


def _kinds_at(draw: Draw, x: float) -> Mapping[str, Outcome]:
    found: dict[str, Outcome] = {}
    share = draw._replace(cases=draw.cases // len(curved.KINDS))
    for name in curved.KINDS:
        outcomes = curved.compete(share, name, _from(share, 1.0, 1e2, least=1.0), offset=x)
        for who, outcome in outcomes.items():
            found[who] = found[who] + outcome if who in found else outcome
    return found


SINGLE = (
    "Mitsuba is held to the law in float32's u, 2^29 times wider than ours: 16 u (|t| |d| + D) is a"
    " radius at 1e6 of them. Its scalar variant solves spheres in float64 and rounds t to float32"
    " afterwards, so that within that law it has no end before ours."
)

FAR, FAR_QUICK = decades(0, 12), (1.0, 1e3, 1e6, 1e9, 1e12)
RIMS = tuple(2.0**k for k in (1, 5, 10, 15, 20, 25, 30, 35, 40, 45, 48, 49, 50, 51, 52))

FAMILY = Family(
    "F1",
    "far and small quadrics",
    "A hit or a miss has the sign of the exact discriminant beyond 5 u of the radius, and |t -"
    " exact| |d| <= 16 u (|t| |d| + D) + 5 u r² / h, at any distance, offset and size.",
    (
        Series(
            "distance",
            "distance / radius",
            "Spheres from 2 to 10 times this far away; half of the rays pass the rim at 2^-1 to"
            " 2^-40 radii. Wrong is a hit for a miss and the reverse, but within 5 u of the rim,"
            " and t beyond its bound.",
            FAR,
            FAR_QUICK,
            {"quick": 3000, "full": 100_000},
            _distance,
            unit=OF_BOUND,
            explained=SINGLE,
        ),
        Series(
            "body",
            "distance / radius",
            "Spheres from 2 to 10 times this far away; no ray passes within 0.05 radii of the rim.",
            FAR,
            FAR_QUICK,
            {"quick": 3000, "full": 30_000},
            _body,
            unit=OF_BOUND,
            explained=SINGLE,
            shoot=shoot,
        ),
        Series(
            "rim",
            "radius / distance of the ray from the rim",
            "Spheres from 2 to 1e6 radii away; half of the rays pass just within the rim, half"
            " just beyond, by once to twice this. No band is left open: this measures it.",
            RIMS,
            (2.0, 2.0**20, 2.0**40, 2.0**50),
            {"quick": 3000, "full": 50_000},
            _rim,
            unit=OF_BOUND,
            explained=SINGLE,
            holds_to=2.0**50,
            law="a gap of 5 u r = 5 · 2^-53 r: the closest approach rounds twice and its square"
            " and r² once each, whatever the distance",
        ),
        Series(
            "offset",
            "distance of the centre from the origin / radius",
            "Spheres that far out, seen from 2 to 1e3 radii; half of the rays near the rim.",
            FAR,
            FAR_QUICK,
            {"quick": 3000, "full": 50_000},
            _offset,
            unit=OF_BOUND,
            explained=SINGLE,
        ),
        Series(
            "size",
            "radius",
            "Spheres of this radius, seen from 2 to 1e3 radii; half of the rays near the rim.",
            decades(-9, 9, 3),
            (1e-9, 1.0, 1e9),
            {"quick": 3000, "full": 50_000},
            _size,
            unit=OF_BOUND,
            explained=SINGLE,
        ),
        *(
            Series(
                name,
                "distance / size",
                f"The {name} from 1 to 10 times this far away; half of the rays aim along the"
                " surface, 2^-1 to 2^-40 sizes above or below it. Wrong is what is right for no ray"
                " that passes within 64 u sizes of this one.",
                FAR,
                (1.0, 1e6, 1e12),
                {
                    "quick": 160 if name == "torus" else 800,
                    "full": 2000 if name == "torus" else 20_000,
                },
                _of(name),
                unit=OF_BOUND,
                explained=SINGLE if name in curved.IN_MITSUBA else "",
            )
            for name in curved.KINDS
        ),
        Series(
            "kinds_offset",
            "distance of the centre from the origin / size",
            "All of these kinds that far out, seen from 1 to 1e3 sizes.",
            FAR,
            (1e6, 1e12),
            {"quick": 900, "full": 12_000},
            _kinds_at,
            unit=OF_BOUND,
            explained=SINGLE,
        ),
    ),
    anchors="pbrt and Mitsuba test no such range; measured, the text-book's quadratic in float64"
    " is wrong for 1.3 % of the rays at 1e7 radii and for 33 % at 1e8.",
)
