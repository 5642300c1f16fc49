"""Rooms and bodies in light that is the same everywhere, for furnaces."""

from typing import Any

import reference_rt as rt
from comparisons.experiments.stability.harness.steps import at, turned
from comparisons.experiments.stability.harness.worlds import World, grey

WALLS = tuple(
    rt.Rectangle(material="wall", transform=(at(0, 0, -1), turned(degrees, axis)))
    for axis, degrees in (
        ((1, 0, 0), 0), ((1, 0, 0), 90), ((1, 0, 0), 180),
        ((1, 0, 0), 270), ((0, 1, 0), 90), ((0, 1, 0), 270),
    )
)  # fmt: skip
"""Their fronts point at the middle of the cube [-1, 1]³."""

UNLIMITED = 10**6

LATEST = 4096
"""Edges after which roulette begins at the latest: no path in glass is that long (measured)."""


def closed(albedo: float, edges: int | None = None, rr_depth: int = 5) -> World:
    """Walls that emit 1 and reflect `albedo`, seen from within: 1 / (1 - a), or as much as comes in
    a number of edges, 1 + a + ... + a^(n - 1)."""
    lost = 0.0 if edges is None else albedo**edges
    return World(
        WALLS,
        {
            "scattering": rt.Diffuse(reflectance=grey(albedo)),
            "wall": rt.Emissive(radiance=grey(1.0), base="scattering"),
        },
        rt.Orthographic(eye=(0.1, 0.2, 0.3), target=(-1, -0.9, -0.8), width=1e-9),
        (1.0 - lost) / (1.0 - albedo),
        {"max_depth": edges, "rr_depth": rr_depth},
    )


def shells(n: int) -> World:
    """n spheres of glass within each other, every other gap filled with air, in a white sky: no
    matter what they bend and mirror, 1 comes out."""
    materials: dict[str, Any] = {
        "solid": rt.Dielectric(interior_ior=1.5),
        "hollow": rt.Dielectric(interior_ior=1.0, exterior_ior=1.5),
    }
    spheres = tuple(
        rt.Sphere(radius=1.0 - 0.9 * k / n, material=("solid", "hollow")[k % 2]) for k in range(n)
    )
    camera = rt.Orthographic(eye=(0, 0, 3), target=(0, 0, 0), width=2.1)
    # Without roulette; light is lost only where a path is cut.
    path = {"max_depth": UNLIMITED, "rr_depth": LATEST}
    return World(spheres, materials, camera, 1.0, path, sky=1.0)
