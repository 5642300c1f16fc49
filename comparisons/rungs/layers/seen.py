"""What Mitsuba sees: film points of its filters, rays of its sensor, colours at its hits."""

from typing import Any, NamedTuple

import numpy as np

from comparisons.cameras.film import translate_filter
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.counterpart import Counterpart
from comparisons.mitsuba.hits import MitsubaHits
from comparisons.mitsuba.scene import for_rays
from comparisons.referee.sizes import LeafSizes, ShapeSizes
from comparisons.textures.texture import Use
from comparisons.textures.translate import translate_texture
from reference_rt.cameras.film import Filter
from reference_rt.core.arrays import FloatArray, IdArray, IntArray
from reference_rt.materials import Diffuse, Wrapper
from reference_rt.rendering.scene import Scene
from reference_rt.textures import Product, VertexColours

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
        colours = np.zeros((len(hits.t), 3))
        for looked in self._by_leaf(hits):
            own = self._own(looked)
            if of_vertices:
                mixed = _vertex_colours(looked)
                own = np.where(mixed[:, :1] >= 0.0, mixed, own)
            colours[looked.rows] = own
        return colours

    def _by_leaf(self, hits: MitsubaHits) -> list[_Looked]:
        leaf, local = self._sizes.leaf_of(hits), self._sizes.local_points(hits)
        parts = []
        for number in np.unique(leaf[leaf >= 0]).tolist():
            rows = np.flatnonzero(leaf == number)
            parts.append(
                _Looked(
                    self._sizes.leaves[number],
                    rows,
                    hits.uv[rows],
                    hits.primitive[rows],
                    local[rows],
                )
            )
        return parts

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
        return self._looked_up(name, _coordinates(looked, texture.uv_set))

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
            texture = self._scene.textures[name].model_copy(update={"uv_set": 0})
            described = translate_texture(texture, name, self._context, Use())
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
    mixed, corners = _mixed(looked, table.colours)
    return np.where(corners[:, :1, 0] >= 0.0, mixed, none)


def _coordinates(looked: _Looked, uv_set: int) -> FloatArray:
    """Texture coordinates (n, 2) of a set."""
    table = looked.leaf.table
    if uv_set == 0 or looked.leaf.field != "triangles" or table.more_uvs is None:
        return looked.uv
    mixed, _ = _mixed(looked, table.more_uvs)
    return mixed[:, 2 * uv_set - 2 : 2 * uv_set]


def _mixed(looked: _Looked, at_corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What vertices have (faces, 3 k), interpolated (n, k), and at the corners (n, 3, k)."""
    row = looked.leaf.row_of(looked.primitive)
    weights = _barycentrics(looked.leaf.table.vertices[row], looked.local)
    corners = at_corners[row].reshape(len(row), 3, -1)
    return np.einsum("nk,nki->ni", weights, corners), corners


def _barycentrics(vertices: FloatArray, p: FloatArray) -> FloatArray:
    """Barycentric coordinates (n, 3) of points (n, 3) in the planes of triangles (n, 9)."""
    v = vertices.reshape(-1, 3, 3)
    normal = np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0])
    areas = [np.sum(normal * np.cross(v[:, k - 2] - p, v[:, k - 1] - p), axis=1) for k in range(3)]
    return np.asarray(np.stack(areas, axis=1) / np.sum(normal * normal, axis=1)[:, None])
