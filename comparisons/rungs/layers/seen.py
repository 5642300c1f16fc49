"""What Mitsuba sees: film points of its filters, rays of its sensor, colours at its hits."""

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from comparisons.cameras.film import translate_filter
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.counterpart import Counterpart, trace
from comparisons.mitsuba.hits import MitsubaHits, rows_of
from comparisons.mitsuba.scene import for_rays
from comparisons.referee.sizes import LeafSizes, ShapeSizes
from comparisons.rungs.rays import arbiter
from comparisons.rungs.rays.camera import camera_rays, ends
from comparisons.rungs.rays.comparer import KINDS, Comparer
from comparisons.rungs.rays.rays import Rays
from comparisons.rungs.rays.resolution import slide
from comparisons.textures.texture import Use
from comparisons.textures.translate import translate_texture
from reference_rt.cameras.film import Filter
from reference_rt.core.arrays import FloatArray, IdArray, IntArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.materials import Diffuse, Wrapper
from reference_rt.rendering import query
from reference_rt.rendering.query import Intersections
from reference_rt.rendering.scene import Scene
from reference_rt.textures import Product, VertexColours

__all__ = ["Centres", "FilmPoints", "Seen", "centres", "sensor_rays"]


CELLS = 1 << 14
"""Cells of a filter's table: the position of a film point is off by a thousandth of a pixel at
most."""


class FilmPoints:
    """Draws points from the absolute value of Mitsuba's filter, as ours are drawn from our own."""

    def __init__(self, film_filter: Filter) -> None:
        plugin = mitsuba().load_dict(translate_filter(film_filter))
        self._radius = float(plugin.radius())
        self._step = 2.0 * self._radius / CELLS
        x = -self._radius + self._step * (np.arange(CELLS) + 0.5)
        values = for_rays(lambda at: (plugin.eval(at),), x)[0]
        self._negative = values < 0.0
        self._cumulative = np.append(0.0, np.cumsum(np.abs(values)))
        self._size = float(np.abs(values).sum() / values.sum())

    def draw(self, pixels: int, side: int, rng: np.random.Generator) -> tuple[FloatArray, ...]:
        """Offsets from the pixel's centre (pixels, side², 2), and the weights (pixels, side²) of
        their values: one in each of side x side cells of equal probability."""
        cell = np.mgrid[0:side, 0:side].reshape(2, -1).T
        u = (cell + rng.uniform(size=(pixels, side * side, 2))) / side
        at = u * self._cumulative[-1]
        cell = np.clip(np.searchsorted(self._cumulative, at, side="right") - 1, 0, CELLS - 1)
        offset = -self._radius + self._step * (cell + rng.uniform(size=at.shape))
        weight = np.where(self._negative[cell], -self._size, self._size)
        return offset, np.prod(weight, axis=2)


def sensor_rays(
    counterpart: Counterpart, film: FloatArray, lens: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Origins (on the near plane) and unit directions (n, 3) of Mitsuba's sensor, in scene units.

    film (n, 2): from (0, 0), the upper left corner, to (1, 1);  lens (n, 2): uniform in the square.
    """
    mi = mitsuba()
    sensor = counterpart.mi_scene.sensors()[0]

    def ray(x: Any, y: Any, u: Any, v: Any) -> tuple[Any, ...]:
        found, _ = sensor.sample_ray_differential(0.0, 0.5, mi.Point2f(x, y), mi.Point2f(u, v))
        return found.o, found.d

    o, d = for_rays(ray, *film.T, *lens.T)
    return counterpart.frame.out(o), d


class _Looked(NamedTuple):
    """The hits of one primitive: its description, its rows in the hits, uv and local points."""

    leaf: LeafSizes
    rows: IntArray
    uv: FloatArray
    primitive: IdArray
    local: FloatArray


class Seen:
    """Colours at Mitsuba's hits, by the scene's description."""

    def __init__(self, scene: Scene, sizes: ShapeSizes) -> None:
        """sizes: of the same scene."""
        self._scene, self._sizes = scene, sizes
        self._context = TranslationContext.of(scene)
        self._textures: dict[str, Any] = {}

    def colours(self, hits: MitsubaHits, of_vertices: bool = False) -> FloatArray:
        """The materials' own colours (n, 3), 0 for a miss;  of_vertices: where a mesh has vertex
        colours, these instead."""
        found = np.zeros((len(hits.t), 3))
        for looked in self._by_leaf(hits):
            own = self._own(looked)
            if of_vertices:
                mixed = _vertex_colours(looked)
                own = np.where(mixed[:, :1] >= 0.0, mixed, own)
            found[looked.rows] = own
        return found

    def _by_leaf(self, hits: MitsubaHits) -> list[_Looked]:
        leaf, local = self._sizes.leaf_of(hits), self._sizes.local_points(hits)
        found = []
        for number in np.unique(leaf[leaf >= 0]).tolist():
            rows = np.flatnonzero(leaf == number)
            found.append(
                _Looked(
                    self._sizes.leaves[number],
                    rows,
                    hits.uv[rows],
                    hits.primitive[rows],
                    local[rows],
                )
            )
        return found

    def _own(self, looked: _Looked) -> FloatArray:
        value = self._shown(looked.leaf.material)
        if not isinstance(value, str):
            return np.tile(np.array(value, dtype=np.float64), (len(looked.rows), 1))
        return self._texture(value, looked)

    def _texture(self, name: str, looked: _Looked) -> FloatArray:
        texture = self._scene.textures[name]
        if isinstance(texture, Product):
            factors = [self._texture(of, looked) for of in texture.of]
            return np.asarray(np.prod(factors, axis=0) * texture.factor)
        if isinstance(texture, VertexColours):
            mixed = _vertex_colours(looked)
            return np.where(mixed[:, :1] >= 0.0, texture.scale * mixed, texture.without)
        return self._looked_up(name, looked.uv)

    def _shown(self, name: str | None) -> tuple[float, float, float] | str:
        """The colour of a material; of a nested one, that of its first base."""
        if name is None:
            return Diffuse().colour
        material = self._scene.materials[name]
        while isinstance(material, Wrapper):
            material = self._scene.materials[getattr(material, material.bases[0])]
        return material.colour

    def _looked_up(self, name: str, uv: FloatArray) -> FloatArray:
        """A texture's colours (n, 3), by Mitsuba."""
        import drjit as dr

        mi = mitsuba()
        if name not in self._textures:
            described = translate_texture(self._scene.textures[name], name, self._context, Use())
            self._textures[name] = mi.load_dict(described)
        texture = self._textures[name]

        def look(u: Any, v: Any) -> tuple[Any, ...]:
            si = dr.zeros(mi.SurfaceInteraction3f)
            si.uv = mi.Point2f(u, v)
            return (texture.eval(si),)

        return np.asarray(for_rays(look, *uv.T)[0])


def _vertex_colours(looked: _Looked) -> FloatArray:
    """Interpolated colours of vertices (n, 3), negative where a shape has none."""
    none = np.full((len(looked.rows), 3), -1.0)
    table = looked.leaf.table
    if looked.leaf.field != "triangles" or table.colours is None:
        return none
    row = looked.leaf.row_of(looked.primitive)
    weights = _barycentrics(table.vertices[row], looked.local)
    corners = table.colours[row].reshape(-1, 3, 3)
    mixed = np.einsum("nk,nki->ni", weights, corners)
    return np.where(corners[:, :1, 0] >= 0.0, mixed, none)


def _barycentrics(vertices: FloatArray, p: FloatArray) -> FloatArray:
    """Barycentric coordinates (n, 3) of points (n, 3) in the planes of triangles (n, 9)."""
    v = vertices.reshape(-1, 3, 3)
    normal = np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0])
    areas = [np.sum(normal * np.cross(v[:, k - 2] - p, v[:, k - 1] - p), axis=1) for k in range(3)]
    return np.asarray(np.stack(areas, axis=1) / np.sum(normal * normal, axis=1)[:, None])


# ---- layers of the rays through the pixels' centres: pixel by pixel, within float32's bound ------


SLACK = 2.0
"""Error bound of a layer over that of a hit: its rays are those of the picture, which Mitsuba gets
rounded to float32; that moves a hit by at most as much again."""

MOVES = 12
"""Directions in which rays next to each ray lie, whose colours by Mitsuba span what float32 may
make of a texture."""

STEPS = 8
"""Rays in each direction.  Where a ray grazes a surface far away they may be texels apart: colours
between two of them are not known better than by the mean difference of neighbours.  Of a single
edge between two texels that is an eighth of the contrast."""

COLOUR = 1e-5
"""Tolerance of a colour that does not vary: float32 texels and their interpolation make some
2 * 2^-24 of the largest."""


class Centres(NamedTuple):
    """pixels, unresolved: how many were compared, and how many float32 does not resolve;  wrong: by
    layer, how many differ;  ratio: the largest error over its bound;  first: the first difference
    in words, or ""."""

    pixels: int
    unresolved: int
    wrong: dict[str, int]
    ratio: float
    first: str


def centres(
    scene: Scene,
    tables: SceneTables,
    counterpart: Counterpart,
    sizes: ShapeSizes,
    layers: Mapping[str, FloatArray],
) -> Centres:
    """Compare layers (height, width[, k]) with Mitsuba's hits of the same rays.

    A pixel where our own hit is not Mitsuba's within the bound lies at an edge: the geometry rung
    judges such rays, and here they are left out.
    """
    film = scene.film
    y, x = np.mgrid[0 : film.height, 0 : film.width]
    x, y = x.ravel() + 0.5, y.ravel() + 0.5
    rays = Rays(*camera_rays(scene, x, y))
    t_max = ends(scene, rays.d)
    ours = query.intersect(tables, *rays, t_max=t_max)
    theirs = trace(counterpart, *rays, t_max=t_max)
    comparer = Comparer(sizes)
    resolved = (comparer.ratios(rays, ours, theirs) <= SLACK).all(axis=1)
    resolved &= ~counterpart.beyond_planes(ours)
    flat = {name: layer.reshape(len(x), -1) for name, layer in layers.items()}
    errors = {
        name: _errors(comparer, rays, ours, theirs, name, values)
        for name, values in flat.items()
        if name != "colour"
    }
    if "colour" in flat:
        errors["colour"] = _of_colours(scene, counterpart, sizes, rays, theirs, flat["colour"])
    wrong, ratio, first = {}, 0.0, ""
    for name, error in errors.items():
        bad = np.flatnonzero(resolved & ~(error <= SLACK))
        good = error[resolved & (error <= SLACK)]
        wrong[name], ratio = len(bad), max(ratio, float(good.max(initial=0.0)) / SLACK)
        if len(bad) and not first:
            k = int(bad[0])
            first = (
                f"{name} of pixel ({int(x[k])}, {int(y[k])}): ours {flat[name][k]}, where Mitsuba "
                f"hits shape {theirs.shape[k]} at t = {theirs.t[k]:.9g}, n = {theirs.n[k]}"
            )
    return Centres(len(x), int(np.count_nonzero(~resolved)), wrong, ratio, first)


def _errors(
    comparer: Comparer,
    rays: Rays,
    ours: Intersections,
    theirs: MitsubaHits,
    name: str,
    values: FloatArray,
) -> FloatArray:
    """(n,): error over bound of a layer (n, k).  The bounds are those of `Comparer`, about our own
    hit; where nothing is hit, the layer must say so exactly."""
    hit, column = ours.shape >= 0, values[:, 0]
    if name == "id":
        return np.where(column == theirs.shape, 0.0, np.inf)
    if name == "uv":
        changed = dataclasses.replace(ours, uv=values)
        ratio = comparer.ratios(rays, changed, theirs)[:, KINDS.index("uv")]
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            e = slide(comparer.sizes, rays.o, rays.d, ours, theirs.sag)
            if name == "normal":
                n = np.where(theirs.stands_in[:, None], theirs.ns, theirs.n)
                feature = np.minimum(comparer.sizes.feature_of(ours), theirs.height)
                bound = e / feature + theirs.turn
                ratio = np.linalg.norm(values - n, axis=1) / bound
            else:
                ratio = np.abs(column - theirs.t) / e  # directions are unit vectors
    of_miss = np.inf if name in ("depth", "distance") else 0.0
    missed = np.where((values == of_miss).all(axis=1), 0.0, np.inf)
    return np.where(hit, np.nan_to_num(ratio, nan=np.inf), missed)


def _of_colours(
    scene: Scene,
    counterpart: Counterpart,
    sizes: ShapeSizes,
    rays: Rays,
    theirs: MitsubaHits,
    values: FloatArray,
) -> FloatArray:
    """(n,): SLACK times the distance from the range of colours that Mitsuba's hits of rays next to
    each have, over the tolerance.  A mesh that stands in for a shape shifts textures further than
    float32 does."""
    seen = Seen(scene, sizes)
    apart = np.zeros(len(scene.shapes) + 1)
    for shape, found in counterpart.stand_ins().items():
        apart[shape] = max(s.sag + s.slip for s in found)
    ratio = _outside(seen.colours(theirs, of_vertices=True), values)
    far = np.flatnonzero(ratio > 1.0)
    if len(far) == 0:
        return SLACK * ratio
    reach = np.full(len(far), sizes.reach.max(initial=0.0))
    some = rays.rows(far)
    delta = sizes.frame.delta(some.o, theirs.p[far], reach)
    radius = 2.0 * (delta + apart[theirs.shape[far]])
    middle = seen.colours(rows_of(theirs, far), of_vertices=True)
    around = np.empty((MOVES, STEPS + 1, *middle.shape))
    around[:, 0] = middle
    for k, move in enumerate(arbiter.directions(MOVES)):
        for step in range(1, STEPS + 1):
            o = some.o + (step / STEPS * radius)[:, None] * move
            around[k, step] = seen.colours(trace(counterpart, o, some.d), of_vertices=True)
    between = np.abs(np.diff(around, axis=1)).mean(axis=1).max(axis=0)
    ratio[far] = _outside(around, values[far], between)
    return SLACK * ratio


def _outside(
    colours: FloatArray, values: FloatArray, slack: FloatArray | float = 0.0
) -> FloatArray:
    """(n,): how far values (n, 3) are outside the range of colours (..., n, 3), and further than
    `slack`, over the tolerance."""
    each = colours.reshape(-1, *values.shape)
    low, high = each.min(axis=0) - slack, each.max(axis=0) + slack
    bound = COLOUR * np.maximum(np.abs(low), np.abs(high)).max(axis=1, keepdims=True)
    off = np.maximum(np.maximum(low - values, values - high), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(off == 0.0, 0.0, off / bound).max(axis=1)
    return np.asarray(np.nan_to_num(ratio, nan=np.inf))
