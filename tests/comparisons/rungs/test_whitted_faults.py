"""Mistakes of ray trees, planted on one side: the rung of Whitted ray tracing sees each."""

import dataclasses
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from comparisons.mitsuba.backend import mitsuba, scalar
from comparisons.mitsuba.counterpart import Counterpart
from comparisons.referee.sizes import ShapeSizes
from comparisons.rungs import whitted
from comparisons.rungs.limited import limited
from comparisons.rungs.rays.plugin_trees import PluginTrees
from comparisons.rungs.rays.rays import Rays, pixel_rays
from comparisons.rungs.rays.tree_error import TreeContext, magnified, roundings
from comparisons.translator import load
from reference_rt import Scene
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Whitted
from reference_rt.rendering import query

SCENES = Path(__file__).parents[3] / "scenes"

Radiance = Callable[..., FloatArray]

ULP = 2.0**-23
"""Of float32, relative: what changes less cannot be seen."""


# ---- mistakes of our renderer --------------------------------------------------------------------


right = query.radiance_without_noise


def changed(**by: Callable[[Any], Any]) -> Radiance:
    def radiance(tables: Any, setup: Any, o: FloatArray, d: FloatArray) -> FloatArray:
        other = {name: change(getattr(setup, name)) for name, change in by.items()}
        return right(tables, setup._replace(**other), o, d)

    return radiance


def only_before(depth: int, without: Callable[[Any], Any]) -> Radiance:
    """Some of the light is lost after `depth` surfaces:  without: the tables that lack it."""

    def radiance(tables: Any, setup: Any, o: FloatArray, d: FloatArray) -> FloatArray:
        lacking = without(tables)
        first = setup._replace(max_depth=min(depth, setup.max_depth))
        kept = right(tables, first, o, d) - right(lacking, first, o, d)
        return np.asarray(kept + right(lacking, setup, o, d))

    return radiance


def without_lamps(tables: Any) -> Any:
    choice = tables.lights.choice
    dark = choice._replace(probability=0.0 * choice.probability)
    return dataclasses.replace(tables, lights=tables.lights._replace(choice=dark))


def without_ambient(tables: Any) -> Any:
    if tables.lights.ambient is None:
        return tables
    dark = tables.lights._replace(ambient=0.0 * tables.lights.ambient)
    return dataclasses.replace(tables, lights=dark)


OURS = {
    "one reflection fewer": changed(max_depth=lambda depth: max(depth - 1, 0)),
    "one reflection more": changed(max_depth=lambda depth: depth + 1),
    "rays of any contribution": changed(min_contribution=lambda least: 0.0),
    "no direct light after a bounce": only_before(0, without_lamps),
    "no direct light after two": only_before(1, without_lamps),
    "ambient light once only": only_before(0, without_ambient),
}


# ---- branches that Mitsuba's side lacks ----------------------------------------------------------


@contextmanager
def lost(mirrored: bool, level: int) -> Iterator[None]:
    """Our plugin for Mitsuba does not follow mirrored rays, or those that pass the surface, where
    `level` surfaces have bent a ray."""
    mi = mitsuba()
    import drjit as dr

    plugin = type(mi.load_dict({"type": "whitted"}))
    own = plugin.branch

    def branch(self: Any, si: Any, weight: Any, active: Any, component: int, depth: int) -> Any:
        followed = own(self, si, weight, active, component, depth)
        if depth != level:
            return followed
        return [
            (ray, w, a & ((si.wi.z * dr.dot(ray.d, si.sh_frame.n) > 0.0) ^ mirrored), k)
            for ray, w, a, k in followed
        ]

    plugin.branch = branch
    try:
        yield
    finally:
        plugin.branch = own


BRANCHES = [(mirrored, level) for mirrored in (True, False) for level in (0, 1, 2, -1)]
"""The last level counts as -1."""


class Planted:
    """A scene, its rays, and both sides' values without a mistake."""

    def __init__(self, scene: Scene, pixels: int) -> None:
        assert isinstance(scene.integrator, Whitted)
        self.scene, self.pixels, self.integrator = scene, pixels, scene.integrator
        self.counterpart: Counterpart = load(scene)
        self.rays = pixel_rays(scene, self.counterpart.frame, pixels)
        self.values = self.ours(), self.theirs()

    def ours(self, radiance: Radiance = right) -> FloatArray:
        return radiance(self.scene.tables, self.integrator.setup(), *self.rays)

    def theirs(self) -> FloatArray:
        trees = PluginTrees(self.scene, self.scene.tables, self.counterpart, self.integrator)
        return trees(self.rays)

    def status(self) -> str:
        found = whitted(self.scene, self.scene.tables, self.counterpart, self.pixels)
        return limited([found])[0].status

    def sees_in_ours(self, name: str, monkeypatch: pytest.MonkeyPatch) -> bool | None:
        """None where the mistake changes nothing that float32 has."""
        if not _changes(self.ours(OURS[name]), self.values[0]):
            return None
        monkeypatch.setattr(query, "radiance_without_noise", OURS[name])
        seen = self.status() == "differ"
        monkeypatch.undo()
        return seen

    def sees_lost(self, mirrored: bool, level: int) -> bool | None:
        with lost(mirrored, level if level >= 0 else self.integrator.max_depth - 1):
            if not _changes(self.theirs(), self.values[1]):
                return None
            return self.status() == "differ"


def _changes(values: FloatArray, known: FloatArray) -> bool:
    return bool((np.abs(values - known).max(axis=1) > ULP * np.abs(known).max(axis=1)).any())


@pytest.fixture(scope="module")
def spheres() -> Iterator[Planted]:
    with scalar():
        yield Planted(Scene.load(SCENES / "spheres_whitted.yaml"), 600)


@pytest.fixture(scope="module")
def few(spheres: Planted) -> Iterator[Planted]:
    """The same with fewer pixels, for mistakes that change many."""
    with scalar():
        yield Planted(spheres.scene, 120)


def test_right_trees_agree(spheres: Planted) -> None:
    with scalar():
        assert spheres.status() == "agree"


@pytest.mark.parametrize("name", list(OURS)[:2])
def test_trees_of_another_depth(
    spheres: Planted, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with scalar():
        assert spheres.sees_in_ours(name, monkeypatch)


@pytest.mark.parametrize("name", list(OURS)[:2])
def test_the_last_of_many_reflections(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of eight, where it adds 0.004 W/sr/m² at most: some ten pixels of 4,000."""
    planted = Planted(Scene.load(SCENES / "whitted_classic.yaml"), 4000)
    assert planted.sees_in_ours(name, monkeypatch)


@pytest.mark.parametrize("name", list(OURS)[2:-1])
def test_mistakes_of_ours(few: Planted, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with scalar():
        assert few.sees_in_ours(name, monkeypatch)


@pytest.mark.parametrize(("mirrored", "level"), [(True, 1), (False, 2)])
def test_lost_branches(few: Planted, mirrored: bool, level: int) -> None:
    with scalar():
        assert few.sees_lost(mirrored, level)


@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [path for path in sorted(SCENES.glob("*.yaml")) if "type: whitted" in path.read_text()],
    ids=lambda path: path.stem,
)
def test_every_scene(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each mistake is seen in each scene that it changes."""
    planted = Planted(Scene.load(path), 4096)
    seen = {name: planted.sees_in_ours(name, monkeypatch) for name in OURS}
    for mirrored, level in BRANCHES:
        seen[f"lost: {'mirrored' if mirrored else 'passing'}, {level}"] = planted.sees_lost(
            mirrored, level
        )
    assert {name for name, one in seen.items() if one is False} == set()


def test_a_pixel_may_be_off_by_its_own_tree_alone() -> None:
    """A mirror's pixel by as much whether a lamp is next to it in the picture or not."""
    text = """
camera: {type: perspective, eye: [0, -4, 1], target: [0, 0, 0.5], up: [0, 0, 1]}
film: {width: 28, height: 21}
integrator: {type: whitted}
materials: {mirror: {type: mirror}, lamp: {type: emissive, radiance: %s}}
shapes:
  - {type: rectangle, material: mirror, transform: [{scale: 3}]}
  - {type: sphere, transform: [{scale: 0.4}, {translate: [0, 0, 0.7]}]}
  - {type: rectangle, material: lamp, transform: [{scale: 0.1}, {rotate: {axis: [1, 0, 0],
     degrees: 90}}, {translate: [0.5, -1.5, 1.1]}]}
lights: [{type: point, position: [1, -3, 4], intensity: 3}]
"""
    bounds, values = [], []
    for radiance in ("1.0e-6", "1.0e+4"):
        scene = Scene.parse(text % radiance)
        with scalar():
            counterpart = load(scene)
            sizes = ShapeSizes(scene, counterpart.frame)
            context = TreeContext(scene, scene.tables, counterpart, sizes, Whitted())
            rays = pixel_rays(scene, counterpart.frame, 588)
            nodes = PluginTrees(scene, scene.tables, counterpart, Whitted()).nodes(rays)
            n = len(rays.o)
            bounds.append(roundings(context, nodes, n) + magnified(context, nodes, n))
        values.append(right(scene.tables, Whitted().setup(), *rays).max(axis=1))
    dim, bright = values
    same = np.abs(bright - dim) <= 1e-9 * bright
    lit = same & (dim > 0.0)
    assert lit.sum() > 20
    assert bright.max() > 1e3 * dim.max()
    np.testing.assert_allclose(bounds[0][lit], bounds[1][lit], rtol=1e-6)


def test_nodes_of_some_rows() -> None:
    """Are counted from the first of these rows."""
    from comparisons.rungs.rays.tree_error import Nodes

    row = np.array([0, 1, 1, 3, 4])
    nodes = Nodes(row, row, np.ones((5, 3)), Rays(np.zeros((5, 3)), np.ones((5, 3))))
    some = nodes.of(np.array([1, 4]))
    assert some.row.tolist() == [0, 0, 1]
    assert some.depth.tolist() == [1, 1, 4]
