"""F9: transformed scenes look the same, and a tracer to which they do not is seen."""

import os
import subprocess
import sys

import numpy as np
import pytest

import reference_rt as rt
from comparisons.experiments import relations
from comparisons.experiments.stability import metamorphic
from comparisons.experiments.stability.harness import scenes
from comparisons.experiments.stability.harness.meshes import write_obj
from comparisons.experiments.stability.harness.outcomes import OURS
from comparisons.experiments.stability.harness.series import Draw, family
from comparisons.experiments.stability.metamorphic import light, rays

EPSILON = 1e-4
"""What an absolute ray epsilon is."""


@pytest.fixture(autouse=True)
def _nothing_remembered():
    _forget()
    yield
    _forget()


def _forget():
    light.remembered.cache_clear()
    light.moved_apart.cache_clear()


def measured(series, x, folder, cases=150, mitsuba=False):
    draw = Draw(np.random.default_rng(5), cases, mitsuba, folder)
    return family("F9").by_name[series].measure(draw, x)


def slow(*setting):
    return pytest.param(*setting, marks=pytest.mark.slow)


# ---- faults that must be seen -------------------------------------------------------------------


@pytest.mark.slow
def test_an_epsilon_is_seen_by_rays(tmp_path, monkeypatch):
    """Hits closer than 1e-4 passed over, as where t_min is a constant."""
    honest = rays.ours

    def with_epsilon(tables, o, d):
        found = honest(tables, o, d)
        near = found.t < EPSILON
        identities = np.where(near[:, None], -1, found.identities)
        return rays.Found(np.where(near, np.inf, found.t), identities)

    monkeypatch.setattr(rays, "ours", with_epsilon)
    assert measured("shrunk", 1e3, tmp_path, cases=30)[OURS].failures == 0
    assert measured("shrunk", 1e6, tmp_path, cases=30)[OURS].failures > 50


@pytest.mark.slow
def test_exact_arithmetic_judges_both_answers(tmp_path):
    """A name exchanged for another is wrong, whatever rounding may do."""
    bench = rays.Bench(scenes.things(tmp_path), 60, np.random.default_rng(1))
    wrong = bench.ours.found.identities.copy()
    wrong[:, 3] += 1
    after = bench.ours._replace(found=rays.Found(bench.ours.found.t, wrong))
    outcome = rays.judged(bench.ours, after, 1.0, exact=False)
    hits = np.count_nonzero(np.isfinite(bench.ours.found.t))
    # Of two triangles beside an edge both may be right.
    assert outcome.failures + outcome.open >= hits - 3
    assert hits > 40


@pytest.mark.slow
def test_solids_are_judged_by_what_is_resolved(tmp_path):
    """What ours finds passes; another operand, nothing, what is behind, and a t that is off do
    not; of two walls that rounding cannot tell apart either may be first, of others one."""
    scene = scenes.solids(tmp_path)
    bench = rays.Bench(scene, 90, np.random.default_rng(3))
    o, d, found = bench.ours.o, bench.ours.d, bench.ours.found
    met = rays.Judge(scene).decide(o, d)
    solid = np.flatnonzero(found.identities[:, 0] > 0)
    assert len(solid) > 20
    nothing = np.array([-1, -1, -1, -1])
    right, part, missed, off = np.zeros(4), 1, 2, 3
    for k in solid.tolist():
        name, t = found.identities[k], found.t[k]
        right[0] += met[k].allows(name, t)
        right[part] += met[k].allows(np.array([name[0], -1, (name[2] + 1) % 3, name[3]]), t)
        right[missed] += met[k].allows(nothing, np.inf)
        right[off] += met[k].allows(name, t * (1.0 + 1e-9))
    assert right[0] >= len(solid) - 1  # one may pass an edge within rounding
    assert (right[1:] <= 2).all()


@pytest.mark.slow
@pytest.mark.parametrize(("gap", "either"), [(2.0**-52, True), (1e-12, False)])
def test_a_film_may_show_or_not(gap, either, tmp_path):
    """Of a wall as thick as `gap`, cut from a box by another."""
    scenes.write_ball(tmp_path)
    cut = rt.Box(transform=[{"translate": [0.0, 0.0, -gap]}])
    film = rt.Difference(of=(rt.Box(), cut), transform=())
    scene = rt.Scene.parse("{}", folder=tmp_path).changed(shapes=(rt.Disk(), film))
    (met,) = rays.Judge(scene).decide(np.array([[0.1, 0.2, 4.0]]), np.array([[0.0, 0, -1]]))
    assert met.allows(np.array([1, -1, 0, 5]), 3.0)
    assert met.allows(np.array([0, -1, 0, 0]), 4.0) == either
    assert not met.allows(np.array([1, -1, 0, 2]), 5.0)


RAY_SERIES = [("translated", 1e8), slow("translated solids", 1e4), slow("shrunk", 1e9)]
RAY_SERIES += [slow("grown", 1e9), ("powers of two", 3.0), ("rearranged", 2.0), ("nested", 2.0)]
RAY_SERIES += [slow("turned", 2.0)]


@pytest.mark.slow
@pytest.mark.parametrize(("series", "x"), RAY_SERIES)
def test_missing_triangles_are_seen_by_rays(series, x, tmp_path, monkeypatch):
    """Half of each mesh, in what is transformed alone."""

    def holed(scene, o, d):
        found = rays.ours(rt.build_tables(scene), o, d)
        gone = found.identities[:, 3] >= 160
        identities = np.where(gone[:, None], -1, found.identities)
        return rays.Found(np.where(gone, np.inf, found.t), identities)

    monkeypatch.setattr(rays.Bench, "found_after", staticmethod(holed))
    assert measured(series, x, tmp_path, cases=600)[OURS].failures > 0


LIGHT_SERIES = [("shrunk light", 1e3), slow("translated light", 1e3), slow("grown light", 1e9)]


def _transformed_alone(monkeypatch, change):
    """`change` the scene that is transformed, not those that it is compared with."""

    def moved(scene, motion):
        found = relations.moved(scene, motion)
        return change(found) if len(scene.shapes) > 1 else found

    monkeypatch.setattr(light, "moved", moved)


@pytest.mark.slow
@pytest.mark.parametrize(("series", "x"), LIGHT_SERIES)
def test_a_missing_triangle_is_seen_in_pictures(series, x, tmp_path, monkeypatch):
    """So few pixels that they are looked at again."""
    ball = scenes.ball()
    middle = np.asarray(ball.triangles_center) @ (0.5, 1.25, 8.5)
    write_obj(tmp_path / "holed.obj", ball.vertices, np.delete(ball.faces, middle.argmax(), axis=0))

    def holed(scene):
        shapes = tuple(
            s.model_copy(update={"file": "holed.obj"}) if isinstance(s, rt.Mesh) else s
            for s in scene.shapes
        )
        return scene.changed(shapes=shapes)

    _transformed_alone(monkeypatch, holed)
    found = measured(series, x, tmp_path)[OURS]
    assert 0 < found.failures <= 2 * light.FEW * 48 * 36


@pytest.mark.slow
@pytest.mark.parametrize(("series", "x"), LIGHT_SERIES)
def test_a_few_pixels_are_seen(series, x, tmp_path, monkeypatch):
    """Twelve pixels of each picture 1e-6 brighter: no scene that is moved by itself shows that."""
    honest = light.colours

    def tinted(contestant, scene):
        found = honest(contestant, scene)
        if np.linalg.norm(np.subtract(scene.camera.eye, scenes.CAMERA.eye)) > 1e-3:
            found[14:17, 20:24] += 1e-6
        return found

    monkeypatch.setattr(light, "colours", tinted)
    assert measured(series, x, tmp_path)[OURS].failures >= 20


LEAVING = """
import sys
from pathlib import Path
import reference_rt as rt
from reference_rt.core import ray
from reference_rt.core.vec3 import dot
from comparisons.experiments.stability.harness import scenes
from comparisons.experiments.stability.metamorphic import light
from comparisons.experiments.relations import Motion
def leave(point, w):
    return point.p + point.n * (1e-6 if dot(w, point.n) >= 0.0 else -1e-6)
move = Motion(float(sys.argv[2]))
scene = scenes.whitted(Path(sys.argv[1])).changed(film=rt.Film(width=8, height=6))
honest = light.judged("ours", scene, move).failures
ray.leave = leave
light.remembered.cache_clear()
light.moved_apart.cache_clear()
print(honest, light.judged("ours", scene, move).failures)
"""


@pytest.mark.slow
@pytest.mark.parametrize("factor", ["1e-3", "1e9"])
def test_an_epsilon_of_rays_that_leave_is_seen(factor, tmp_path):
    """Without compiled kernels, where a kernel can be exchanged for another.  Of 48 pixels those
    that mirror or refract show it: what is lit is shaded where it is, not where rays begin."""
    command = [sys.executable, "-c", LEAVING, str(tmp_path), factor]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, check=True, capture_output=True, env=environment, text=True)
    honest, wrong = map(int, done.stdout.split())
    assert honest == 0
    assert wrong >= 3


# ---- Mitsuba ------------------------------------------------------------------------------------


def test_offsets_are_exact():
    """As far as the family says that they are."""
    moved = metamorphic.offset(metamorphic.EXACT_TO)
    p = (7.984375, -7.984375, 0.015625)
    far = moved.points([p])[0].tolist()
    assert tuple(a - b for a, b in zip(far, moved.offset, strict=True)) == p
