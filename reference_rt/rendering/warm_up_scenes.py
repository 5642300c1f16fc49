"""Small scenes that have, together, every type of table: see `warm_up.py`.

A table's type depends on which of its optional arrays it has.  So there is a scene for each such
combination that descriptions can reach: shapes in a hierarchy and without one, triangles with each
choice of normals, texture coordinates and colours, and so on.  All other parts of a scene are kept
as rich as possible, since a kernel is needed only if the scene asks for it: tangents, for example,
if a material is anisotropic.
"""

import tempfile
from collections.abc import Iterable, Iterator
from itertools import chain, cycle, product
from pathlib import Path
from typing import Any

import numpy as np

from reference_rt.cameras import Orthographic, Perspective, ThinLens
from reference_rt.cameras.film import (
    AnyFilter,
    BoxFilter,
    CatmullRomFilter,
    Film,
    GaussianFilter,
    LanczosFilter,
    LayerName,
    MitchellFilter,
    TentFilter,
)
from reference_rt.integrators import Whitted
from reference_rt.lights import Constant, Directional, EnvironmentMap, Point, Projector, Spot
from reference_rt.lights.selection.choice import FEW
from reference_rt.materials import (
    Blend,
    Bump,
    Conductor,
    Dielectric,
    Diffuse,
    Emissive,
    Mirror,
    NormalMap,
    Phong,
    Plastic,
    Principled,
    PrincipledThin,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
    ThinDielectric,
    TwoSided,
)
from reference_rt.sampling import Grid, Independent, Sobol
from reference_rt.scene.build import BuiltScene
from reference_rt.shapes import (
    Box,
    Disk,
    Mesh,
    Plane,
    Polygon,
    Quadric,
    Rectangle,
    Sphere,
    Torus,
)
from reference_rt.shapes.csg import Union
from reference_rt.shapes.instances import Instance
from reference_rt.textures import Bitmap, Checker, VertexColours

_IMAGE = "image.npy"
_LAYERS: tuple[LayerName, ...] = ("albedo", "depth")  # each is written by a kernel of its own

_TEXTURES = {
    "checker": Checker(),
    "bitmap": Bitmap(file=_IMAGE, encoding="raw"),
    "vertex colours": VertexColours(),
}

_FEW = {
    "diffuse": Diffuse(),
    "mirror": Mirror(),
    "brushed": RoughConductor(eta=(0.2, 0.2, 0.2), k=(3.0, 3.0, 3.0), alpha=(0.1, 0.4)),
    "lamp": Emissive(radiance=(1.0, 1.0, 1.0)),
}
"""A few BSDFs.  "brushed" is anisotropic: with it kernels for tangents are needed."""

_LEAVES = {
    **_FEW,
    "dielectric": Dielectric(),
    "conductor": Conductor(eta=(0.2, 0.2, 0.2), k=(3.0, 3.0, 3.0)),
    "thin": ThinDielectric(),
    "frosted": RoughDielectric(),
    "plastic": Plastic(),
    "rough plastic": RoughPlastic(),
    "principled": Principled(),
    "principled thin": PrincipledThin(),
    "phong": Phong(diffuse=(0.1, 0.1, 0.1)),
}
"""Every BSDF."""

_NESTED = {
    "blend": Blend(first="diffuse", second="mirror"),
    "bump": Bump(base="diffuse", height="bitmap"),
    "normal map": NormalMap(base="diffuse", normals="bitmap"),
}
"""Each has a table of its own, which a scene without such materials lacks."""

_LAMPS = (
    Spot(origin=(0.0, 3.0, 0.0), target=(0.0, 0.0, 0.0), intensity=(1.0, 1.0, 1.0)),
    Projector(
        origin=(0.0, 3.0, 0.0),
        target=(0.0, 0.0, 0.0),
        up=(0.0, 0.0, 1.0),
        irradiance=(1.0, 1.0, 1.0),
    ),
    Directional(direction=(0.0, -1.0, 0.0), irradiance=(1.0, 1.0, 1.0)),
    *(Point(position=(k, 3.0, 0.0), intensity=(1.0, 1.0, 1.0)) for k in range(FEW)),
)
"""With a lamp of any other type more than FEW lights: a tree picks among them."""

_SKIES = (
    Constant(radiance=(1.0, 1.0, 1.0)),
    EnvironmentMap(file=_IMAGE),
)

_SAMPLERS = Sobol(spp=4), Independent(spp=4), Grid(spp=4)
_CAMERAS = Perspective(), Orthographic(), ThinLens(aperture_radius=0.1)
_FILTERS: tuple[AnyFilter, ...] = (
    BoxFilter(),
    TentFilter(),
    GaussianFilter(),
    MitchellFilter(),
    CatmullRomFilter(),
    LanczosFilter(),
)


def _mesh(normals: bool, uv: bool, colours: bool) -> Mesh:
    """A triangle whose table has the optional columns that are asked for."""
    return Mesh(
        vertices=np.eye(3),
        faces=np.array([[0, 1, 2]]),
        normals=np.tile((0.0, 0.0, 1.0), (3, 1)) if normals else None,
        uv=np.eye(3)[:, :2] if uv else None,
        colours=np.eye(3) if colours else None,
        material="lamp",
    )


_TETRAHEDRON = Mesh(
    vertices=np.concatenate([np.zeros((1, 3)), np.eye(3)]),
    faces=np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)

_FEW_SHAPES: tuple[tuple[Any, ...], ...] = (
    (
        Sphere(material="lamp"),
        Rectangle(material="lamp"),
        Box(material="lamp"),
        Disk(material="lamp"),
        Plane(),
    ),
    (
        Polygon(rings=(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),)),
        Quadric(coefficients=(1, 1, 1, 0, 0, 0, 0, 0, 0, -1), lower=(-1, -1, -1), upper=(1, 1, 1)),
        Torus(),
    ),
)
"""One of each type but triangles; few enough together to need no hierarchy."""

_SOLID = Union(of=(Sphere(), Sphere(center=(1.0, 0.0, 0.0))))
_COPY = Instance(group="group")


def scenes() -> Iterator[BuiltScene]:
    """Scenes that have, together, every type of table, and their tables are built."""
    with tempfile.TemporaryDirectory() as folder:
        np.save(Path(folder) / _IMAGE, np.full((2, 2, 3), 0.5))
        for scene in _scenes(Path(folder)):
            assert scene.tables
            yield scene


def _scenes(folder: Path) -> Iterator[BuiltScene]:
    """folder: has the image."""

    def scene(**parts: Any) -> BuiltScene:
        rich = {
            "film": Film(width=1, height=1, layers=_LAYERS),
            "textures": _TEXTURES,
            "materials": {**_FEW, **_NESTED},
            "shapes": (_mesh(True, True, True),),
            "lights": (*_LAMPS, _SKIES[0]),
        }
        made = BuiltScene(**{**rich, **parts})
        made._folder = folder
        return made

    for shapes in _FEW_SHAPES:
        yield scene(shapes=shapes)
    yield scene(shapes=(*chain(*_FEW_SHAPES), _SOLID), hierarchy="sah")
    # Triangles and nested materials: their choices are independent, and share scenes.
    for columns, names in zip(product((False, True), repeat=3), _subsets(_NESTED), strict=True):
        # A sheet is nested, but has no table of its own.
        nested = {"sheet": TwoSided(base="diffuse"), **{name: _NESTED[name] for name in names}}
        parts = {"materials": _FEW | nested, "shapes": (_mesh(*columns),)}
        yield scene(**parts)
        yield scene(**{**parts, "shapes": (*parts["shapes"], _SOLID), "hierarchy": "sah"})
    for triangles, solids, copies in product((0, 1), repeat=3):
        yield scene(
            shapes=(
                Sphere(),
                *(_TETRAHEDRON,) * triangles,
                *(_SOLID,) * solids,
                *(_COPY,) * copies,
            ),
            groups={"group": (Sphere(),)},
            hierarchy="sah",
        )
    for method in ("median", "spatial"):
        yield scene(hierarchy=method)
    for names in _subsets(_TEXTURES):
        yield scene(textures={name: _TEXTURES[name] for name in names}, materials=_FEW)
    yield scene(materials=_LEAVES)
    cycled = zip(_FILTERS, cycle(_CAMERAS), cycle(_SAMPLERS), cycle(_SKIES), strict=False)
    for of_film, camera, sampler, sky in cycled:
        yield scene(
            film=Film(width=1, height=1, filter=of_film, layers=_LAYERS),
            camera=camera,
            integrator=Whitted(),  # the only one for which all samplers may be
            sampler=sampler,
            lights=(*_LAMPS, sky),
        )


def _subsets(names: Iterable[str]) -> Iterator[list[str]]:
    kept = [*names]
    for chosen in product((False, True), repeat=len(kept)):
        yield [name for name, is_chosen in zip(kept, chosen, strict=True) if is_chosen]


__all__ = ["scenes"]
