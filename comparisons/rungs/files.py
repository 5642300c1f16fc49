"""The rung `files`: whether our tables hold what the scene's files and descriptions say.

The other rungs compare two renderers that are fed from our readers and our tables: a mesh that we
read 5 % too large is too large in both.  Here each shape and image is held against sources that
share nothing with them:

- files of meshes: Mitsuba's own loader (.obj, .ply), or trimesh (.stl, .off, .gltf, .glb), for
  corners, faces, normals and uv; smooth normals by their formula;
- images: Mitsuba's own loader, and its conversion to linear values; between texels, at the seams of
  repeated images and skies and beyond borders, that loader's texels by the formula in NumPy;
- transforms and maps of instances: SciPy's rotations and NumPy's inverse, for normals too;
- spheres, boxes, cylinders, ...: the equation of the description's own numbers, at the points and
  for the normals that our tracer finds.

What no second source reads is counted, and named.
"""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.geometry import affine
from comparisons.geometry.flatten import maps_of
from comparisons.mitsuba.second import Corners, by_second, by_us, image, rounding_of
from comparisons.results.case import RungResult
from comparisons.shapes import type_of
from reference_rt.core.arrays import FloatArray, IntArray
from reference_rt.core.vec3 import Vec3
from reference_rt.lights import EnvironmentMap
from reference_rt.lights.emitters import environment_map
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Mesh, Triangle
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.shape import Shape, Solid, TabulationContext
from reference_rt.textures import Bitmap
from reference_rt.textures.bitmap import lookup

FLOAT32 = 2.0**-24
"""The rounding of the numbers that Mitsuba holds."""

LEAST32 = 2.0**-126
"""The least number that float32 holds with all of its bits."""

MOST_TRIANGLES = 4_000_000
"""Triangles of a scene after which no further mesh is checked: these take some seconds."""

MOST_SHAPES = 200
"""Most shapes of a scene that are checked, evenly chosen: a shape takes some milliseconds."""

RAYS = 64
"""Rays at a shape without a table of corners."""


@dataclass
class Found:
    """checked: how many of each kind;  unread: what no second source reads;  differences: what
    differs, the first one first;  triangles: how many have been compared."""

    checked: dict[str, int] = field(default_factory=dict)
    unread: list[str] = field(default_factory=list)
    differences: list[str] = field(default_factory=list)
    triangles: int = 0

    def count(self, kind: str) -> None:
        self.checked[kind] = self.checked.get(kind, 0) + 1


def files(scene: Scene) -> RungResult:
    """Compare what we hold of a scene's shapes and images with second sources."""
    found = Found()
    shapes = list(_shapes(scene))
    step = max(1, -(-len(shapes) // MOST_SHAPES))
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # they were issued when the scene was built
        for where, shape in shapes[::step]:
            _check_shape(where, shape, scene.folder, found)
        for name, texture in scene.textures.items():
            if isinstance(texture, Bitmap):
                _check_bitmap(f"textures.{name}", texture, scene.folder, found)
        for i, light in enumerate(scene.lights):
            if isinstance(light, EnvironmentMap):
                _check_environment(f"lights[{i}]", light, scene.folder, found)
    numbers: dict[str, Any] = {"checked": found.checked, "unread": sorted(set(found.unread))}
    if found.differences:
        more = len(found.differences) - 1
        others = f"; and {more} more" if more else ""
        return RungResult("files", "differ", found.differences[0] + others, numbers)
    if not found.checked:
        return RungResult(
            "files", "not-applicable", "no file or shape has a second source", numbers
        )
    facts = ", ".join(f"{kind} {count}" for kind, count in sorted(found.checked.items()))
    left_out = f"; without a second source: {', '.join(numbers['unread'])}"
    reason = f"as second sources say: {facts}{left_out if found.unread else ''}"
    return RungResult("files", "agree", reason, numbers)


def _shapes(scene: Scene) -> Iterator[tuple[str, Shape]]:
    """Every shape of a scene with its place: those of groups and the operands of solids, too."""
    groups = ((f"groups.{name}", shapes) for name, shapes in scene.groups.items())
    waiting = [
        (f"{place}[{i}]", shape)
        for place, shapes in (("shapes", scene.shapes), *groups)
        for i, shape in reversed(list(enumerate(shapes)))
    ]
    while waiting:
        place, shape = waiting.pop()
        if isinstance(shape, Solid):
            waiting += [(f"{place}.of[{i}]", one) for i, one in enumerate(shape.of)]
        else:
            yield f"{place} ({type(shape).__name__.lower()})", shape


def _check_shape(where: str, shape: Shape, folder: Path, found: Found) -> None:
    if isinstance(shape, Mesh | Triangle):
        _check_mesh(where, shape, folder, found)
    elif isinstance(shape, Instance):
        ours, theirs = shape.maps(folder), np.array(maps_of(shape, folder))
        error = np.abs(ours - theirs).max(axis=(1, 2))
        # A few products of rounded matrices.
        if (error > 2.0**-44 * np.abs(theirs).max(axis=(1, 2))).any():
            k = int(error.argmax())
            found.differences.append(
                f"{where}: copy {k} has the map {_text(ours[k])}; its description says "
                f"{_text(theirs[k])}"
            )
        found.count("instances")
    elif type_of(shape).surface is not None:
        _check_equation(where, shape, found)
    else:
        found.unread.append(type(shape).__name__.lower())


# ---- meshes --------------------------------------------------------------------------------------


def _check_mesh(where: str, mesh: Mesh | Triangle, folder: Path, found: Found) -> None:
    if found.triangles > MOST_TRIANGLES:
        found.unread.append(f"meshes beyond {MOST_TRIANGLES:,} triangles")
        return
    if isinstance(mesh, Mesh) and mesh.file is not None:
        where = where.replace("(mesh)", f"({mesh.file})")
    table = mesh.tabulate(TabulationContext(folder=folder))
    found.triangles += len(table.face)
    ours = by_us(mesh, folder)
    second = by_second(mesh, folder, ours)
    if second is not None:
        _compare(where, table, second, affine.of_steps(mesh.transform), found)
        found.count("meshes" if isinstance(mesh, Mesh) else "triangles")
        return
    assert isinstance(mesh, Mesh)
    assert mesh.file is not None
    suffix = Path(mesh.file).suffix.lower()
    found.unread.append(
        f"{suffix} of concave polygons, or with uv and normals in part"
        if ours.doubtful
        else f"{suffix} that no other reader takes, or beyond float32"
    )


def _compare(where: str, table: Any, second: Corners, m: affine.Affine, found: Found) -> None:
    """A table of triangles against a second source under a transform."""
    linear, offset, source = m[:, :3], m[:, 3], second.source
    order = [0, 2, 1] if np.linalg.det(linear) < 0.0 else [0, 1, 2]  # the front stays the front
    corners = (second.points @ linear.T + offset)[:, order]
    kept: IntArray = table.face
    if len(kept) and kept.max() >= len(corners):
        found.differences.append(
            f"{where}: has {kept.max() + 1} triangles; {source} finds {len(corners)}"
        )
        return
    sides = corners[:, 1:] - corners[:, :1]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    # A product of three rounded numbers, of the size of the coordinates.
    size = np.abs(second.points) @ np.abs(linear).T + np.abs(offset)
    rounding = 4.0 * FLOAT32 * float(size.max(initial=0.0)) + LEAST32 * float(np.abs(linear).max())
    longest = np.linalg.norm(sides, axis=-1).max(axis=1, initial=0.0)
    lost = np.ones(len(corners), bool)
    lost[kept] = False
    if (seen := np.flatnonzero(lost & (area > 8.0 * rounding * (longest + rounding)))).size:
        found.differences.append(
            f"{where}: lacks triangle {seen[0]} of {len(corners)}, which {source} has"
        )
        return
    normals, condition = second.normals, float(np.linalg.cond(linear))
    bent: Any = 16.0 * FLOAT32 * condition
    if normals is not None:
        normals = normals @ np.linalg.inv(linear)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        if second.bent is not None:
            bent = (second.bent[kept][:, order] + 2.0**-46) * condition
    uv = second.uv
    of_uv = 4.0 * FLOAT32 * float(np.abs(uv).max(initial=1.0)) if uv is not None else 0.0
    for column, what, ours, theirs, most in (
        ("points", "is at", table.vertices, None, rounding),
        ("normals", "has the normal", table.normals, normals, bent),
        ("uv", "has the uv", table.uvs, uv, of_uv),
        ("colours", "has the colour", table.colours, second.colours, 4.0 * FLOAT32),
    ):
        expected = corners[kept] if column == "points" else None
        if theirs is not None:
            expected = theirs[kept][:, order]
        if expected is None:
            # Mirrored triangles without uv get some, so that these keep their place.
            made = column in second.silent or (column == "uv" and order != [0, 1, 2])
            if ours is not None and not made:
                found.differences.append(f"{where}: has {column}; {source} finds none")
        elif ours is None:
            found.differences.append(f"{where}: no corner {what} that {source} finds")
        else:
            ours = ours.reshape(expected.shape)
            error = np.abs(ours - expected).max(axis=-1) - most
            if (error > 0.0).any():
                k, corner = np.unravel_index(int(error.argmax()), error.shape)
                found.differences.append(
                    f"{where}: corner {corner} of triangle {kept[k]} {what} "
                    f"{_text(ours[k, corner])}; {source} has {_text(expected[k, corner])}"
                )


def _text(numbers: Any) -> str:
    return f"({', '.join(f'{x:.6g}' for x in np.ravel(numbers))})"


# ---- shapes with an equation ---------------------------------------------------------------------


def _unit(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def _check_equation(where: str, shape: Shape, found: Found) -> None:
    """Rays at places within the shape, from everywhere; they must meet it where its equation holds,
    and reach as far as it does."""
    of = type_of(shape)
    assert of.surface is not None
    surface, m = of.surface(shape), affine.of_steps(shape.transform)
    linear, offset = m[:, :3], m[:, 3]
    inverse = np.linalg.inv(linear)
    rng = np.random.default_rng(38)
    half, middle = np.array(surface.half), np.array(surface.middle)
    size = float(np.linalg.norm(half))
    target = middle + half * rng.uniform(-0.95, 0.95, (RAYS, 3))
    begin = middle + 4.0 * size * _unit(rng.normal(size=(RAYS, 3)))
    o, d = begin @ linear.T + offset, (target - begin) @ linear.T
    hits = Scene(shapes=(shape.model_copy(update={"material": None}),)).intersect(o, d)
    found.count(of.table.field if of.table else f"{type(shape).__name__.lower()}s")
    if not hits.hit.any():
        if surface.is_full:
            found.differences.append(f"{where}: rays do not meet it where its description is")
        return
    q = (hits.p[hits.hit] - offset) @ inverse.T
    # Our points are right to some ulp of the coordinates, in the world, seen in the shape's space.
    reach = float(np.abs(hits.p[hits.hit]).max() + np.abs(offset).max())
    rounding = 2.0**-40 * (size + np.linalg.norm(inverse, 2) * reach)
    error = surface.distance(q)
    p, n = hits.p[hits.hit], hits.n[hits.hit]
    k = int(error.argmax())
    if error[k] > rounding:
        found.differences.append(
            f"{where}: is met at {_text(p[k])}, {error[k]:.3g} off the surface that is described, "
            "in its own space"
        )
        return
    gradient = surface.normals(q)
    is_smooth = np.linalg.norm(gradient, axis=1) > 0.0
    p, n, expected = p[is_smooth], n[is_smooth], _unit(gradient[is_smooth] @ inverse)
    # Mirrored shapes keep the front of their description.
    off = np.linalg.norm(expected - n, axis=1)
    if len(off) and off.max() > 3e-5 + 16.0 * rounding / size:
        k = int(off.argmax())
        found.differences.append(
            f"{where}: has the normal {_text(n[k])} at {_text(p[k])}; expected {_text(expected[k])}"
        )


# ---- images --------------------------------------------------------------------------------------


def _compare_images(
    where: str, path: Path, ours: FloatArray, theirs: FloatArray, scale: float, found: Found
) -> None:
    if ours.shape != theirs.shape:
        found.differences.append(
            f"{where}: {path.name} has {ours.shape[1]} x {ours.shape[0]} pixels; Mitsuba's loader "
            f"finds {theirs.shape[1]} x {theirs.shape[0]}"
        )
        return
    theirs = theirs * scale
    error = np.abs(ours - theirs) - rounding_of(path, theirs, scale)
    if (error > 0.0).any():
        y, x, _ = np.unravel_index(int(error.argmax()), error.shape)
        found.differences.append(
            f"{where}: {path.name}: the pixel at column {x}, row {y} is {_text(ours[y, x])}; "
            f"Mitsuba's loader has {_text(theirs[y, x])}"
        )
    found.count("images")


def _check_bitmap(where: str, bitmap: Bitmap, folder: Path, found: Found) -> None:
    path = folder / bitmap.file
    theirs = image(path, bitmap.encoding, bitmap.layer, bitmap.channel)
    if theirs is None:
        found.unread.append(path.suffix.lower())
        return
    texels, before = bitmap.read(folder), len(found.differences)
    if len(texels.decoded):
        codes = texels.values if texels.values.dtype != np.float16 else texels.values.view("u2")
        ours = texels.decoded[codes]
    else:
        ours = texels.values.astype(np.float64) * texels.scale
    ours = np.broadcast_to(ours, (*ours.shape[:2], 3))
    _compare_images(where, path, ours, theirs, bitmap.scale, found)
    if len(found.differences) > before:
        return
    theirs, table = theirs * bitmap.scale, bitmap.tabulate(folder)
    height, width = theirs.shape[:2]
    x, y = _at_borders(width), _at_borders(height)
    columns, lines = (
        partial(_wrapped, n=n, wrap=w) for n, w in zip((width, height), bitmap.wraps, strict=True)
    )
    if bitmap.filter == "nearest":
        expected = theirs[lines(np.floor(y)[:, None]), columns(np.floor(x))]
    else:
        expected = _bilinear(theirs, x - 0.5, y - 0.5, columns, lines)
    seen = np.array([[lookup(table, 0, u, v) for u in x / width] for v in 1.0 - y / height])
    if bitmap.cutoff is not None:
        slack = rounding_of(path, expected, bitmap.scale)
        unclear = np.abs(expected - bitmap.cutoff) <= slack
        expected = np.where(unclear, seen, expected >= bitmap.cutoff)
    _compare_seen(where, path, (x, y), seen, expected, (theirs, bitmap.scale), found)


def _at_borders(n: int) -> FloatArray:
    """Positions on an axis of n texels, in texels: at both sides of its first texel, its middle and
    its end, and at those of the images before and after."""
    borders = np.unique([-n, 0, n // 2, n, 2 * n])
    return np.asarray((borders[:, None] + [-0.4, -1e-3, 1e-3, 0.4]).ravel())


def _wrapped(k: FloatArray, n: int, wrap: str) -> IntArray:
    """Texels, 0 to n - 1, of an axis that is continued beyond its n texels."""
    index = k.astype(np.int64)
    if wrap == "clamp":
        return np.clip(index, 0, n - 1)
    index = index % (n if wrap == "repeat" else 2 * n)
    return np.where(index < n, index, 2 * n - 1 - index)


Index = Callable[[FloatArray], IntArray]


def _bilinear(
    texels: FloatArray, x: FloatArray, y: FloatArray, columns: Index, lines: Index
) -> FloatArray:
    """(len(y), len(x), 3): between the centres of texels, which lie at whole x and y."""
    left, above = np.floor(x), np.floor(y)
    s, t = (x - left)[:, None], (y - above)[:, None, None]
    upper, lower = (
        texels[lines(row)[:, None], columns(left)] * (1.0 - s)
        + texels[lines(row)[:, None], columns(left + 1.0)] * s
        for row in (above, above + 1.0)
    )
    return np.asarray(upper * (1.0 - t) + lower * t)


def _check_environment(where: str, light: EnvironmentMap, folder: Path, found: Found) -> None:
    path, table = folder / light.file, light.tabulate(folder)
    theirs = image(path, light.encoding, light.layer)
    to_map, expected = (
        table.to_map.reshape(3, 3),
        np.linalg.inv(affine.of_steps(light.transform)[:, :3]),
    )
    if theirs is None:
        found.unread.append(path.suffix.lower())
    else:
        before = len(found.differences)
        _compare_images(where, path, table.texels, theirs, light.scale, found)
        if len(found.differences) == before:
            _check_sky(where, path, table, theirs * light.scale, light.scale, found)
    if np.abs(to_map - expected).max() > 1e-5:  # seven digits are taken for a rotation
        found.differences.append(
            f"{where}: turns directions by {_text(to_map)}; its transform undone is "
            f"{_text(expected)}"
        )


def _check_sky(
    where: str,
    path: Path,
    table: environment_map.EnvironmentMaps,
    theirs: FloatArray,
    scale: float,
    found: Found,
) -> None:
    """Directions at the seam of a sky, at the opposite meridian, and at its poles."""
    height, width = theirs.shape[:2]
    x = _at_borders(width)
    y = np.array([1e-3, 0.4, 0.5 * (height - 1) + 0.2, height - 1.4, height - 1.001])
    turn, polar = 2.0 * np.pi * x / width, np.pi * y[:, None] / (height - 1)
    right, up, back = np.broadcast_arrays(
        np.sin(polar) * np.sin(turn), np.cos(polar), -np.sin(polar) * np.cos(turn)
    )
    d = np.stack([right, up, back], axis=-1) @ table.to_map.reshape(3, 3)
    seen = np.array([[environment_map.radiance(table, Vec3(*ray)) for ray in row] for row in d])
    expected = _bilinear(
        theirs, x - 0.5, y, partial(_wrapped, n=width, wrap="repeat"), lambda k: k.astype(np.int64)
    )
    _compare_seen(where, path, (x, y), seen, expected, (theirs, scale), found)


def _compare_seen(
    where: str,
    path: Path,
    at: tuple[FloatArray, FloatArray],
    seen: FloatArray,
    expected: FloatArray,
    scaled: tuple[FloatArray, float],
    found: Found,
) -> None:
    """Values (len(y), len(x), 3) at places x, y, in texels from the upper left corner;  scaled:
    Mitsuba's texels times a scale, and that."""
    texels, scale = scaled
    greatest = float(np.abs(texels).max())
    # Between texels of both signs the value may be smaller than their rounding.
    size = expected if texels.min() >= 0.0 else np.full_like(expected, greatest)
    # The rounding of a place moves it by less than 2^-40 of a texel.
    slack = rounding_of(path, size, scale) + 2.0**-40 * greatest
    wrong = ~(np.abs(seen - expected) <= slack).all(axis=-1)
    if not wrong.any():
        return
    j, i = np.argwhere(wrong)[0]
    found.differences.append(
        f"{where}: {path.name}: {np.count_nonzero(wrong)} of {wrong.size} places at borders of "
        f"texels differ; {at[0][i]:.6g} texels from the left and {at[1][j]:.6g} from the top we "
        f"see {_text(seen[j, i])}; Mitsuba's texels make it {_text(expected[j, i])}"
    )
