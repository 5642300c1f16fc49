"""`comparisons.testing`: right materials pass, ours among them, and mistakes are seen.

The mistakes are in a rough metal and a floor written here in NumPy.
"""

import importlib.util
import math
import sys
from pathlib import Path

import numpy as np
import pytest

import comparisons
from comparisons.gate.material import (
    FEWEST,
    check_material,
    chi_square,
    furnace,
    reciprocity,
    views_of,
    weights,
)
from reference_rt import Constant, Perspective, Scene, Sphere
from reference_rt.materials import AnyMaterial, Bump, Dielectric, NormalMap, Phong, Principled
from reference_rt.scene.examples import NAMED, examples, write_files
from reference_rt.util.errors import SceneError, UsageError

ROOT = Path(__file__).parents[3]
BOTH = "reciprocity"

MATERIALS = {f"{type(m).__name__}{k}": m for k, m in enumerate(examples(AnyMaterial))}


def floor(wo, wi):
    """A diffuse floor of albedo .8."""
    return np.where((wi[:, 2] > 0) & (wo[:, 2] > 0), 0.8 / math.pi * wi[:, 2], 0.0)


def floor_pdf(wo, wi):
    return floor(wo, wi) / 0.8


def floor_sample(wo, u):
    r, turn = np.sqrt(u[:, 0]), 2.0 * math.pi * u[:, 1]
    wi = np.stack([r * np.cos(turn), r * np.sin(turn), np.sqrt(1.0 - u[:, 0])], axis=1)
    return wi, np.full(len(u), 0.8)


@pytest.fixture(scope="module")
def metal():
    """The example's functions: GGX in NumPy, and three mistakes."""
    path = ROOT / "examples/own_material.py"
    spec = importlib.util.spec_from_file_location("own_material", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def failed(*functions, **options):
    return [found.name for found in check_material(*functions, **options) if not found]


@pytest.mark.cases(8)
@pytest.mark.parametrize("name", MATERIALS)
def test_our_materials_pass(name, tmp_path, monkeypatch):
    """The smooth part of each: perfect lobes count as draws that failed."""
    monkeypatch.chdir(tmp_path)
    write_files(tmp_path)
    material = MATERIALS[name]
    shapes, lights = (Sphere(material="sample"),), (Constant(radiance=1.0),)
    named = {**NAMED, "materials": {**NAMED["materials"], "sample": material}}
    camera = Perspective(eye=(0, 0, 4), target=(0, 0, 0), fov=20)
    try:
        scene = Scene(camera=camera, shapes=shapes, lights=lights, **named)
        bsdf = scene.bsdf("sample")
    except SceneError as error:  # Phong's, where it creates light: ours refuse it themselves
        assert "creates energy" in str(error)  # noqa: PT017
        return

    def sample(wo, u):
        found = bsdf.sample(wo, u)
        lost = (found.pdf <= 0.0) | found.is_delta
        wi, weight = found.wi.copy(), found.weight.copy()
        wi[lost], weight[lost] = np.nan, 0.0
        return wi, weight

    eta = None
    if hasattr(material, "interior_ior"):
        eta = float(np.mean(material.interior_ior)) / float(np.mean(material.exterior_ior))
    wi = sample(views_of()[:1].repeat(256, axis=0), np.random.default_rng(0).random((256, 3)))[0]
    if np.isnan(wi).all():
        return  # perfect lobes alone
    passes = bool((wi[:, 2] < 0).any())
    # Shading normals are not reciprocal (Veach 1997, 5.3), nor is the lectures' Phong, whose
    # highlight has no cosine; a sheen may create light, see below.
    reciprocal = not isinstance(material, Bump | NormalMap | Phong)
    options = {"eta": eta if passes else None, "reciprocal": reciprocal}
    may_fail = {"furnace"} if getattr(material, "sheen", 0.0) else set()
    assert set(failed(bsdf.evaluate, sample, bsdf.pdf, **options)) <= may_fail


def test_right_functions_pass(metal):
    assert failed(metal.evaluate, metal.sample, metal.pdf) == []
    assert failed(floor, floor_sample, floor_pdf) == []
    assert failed(floor, lambda wo, u: floor_sample(wo, u)[0], floor_pdf) == []  # no weights


def rounded(function, inside):
    """The same in float32: what it returns, or, `inside`, what it gets, so that float64 arrays come
    of it."""

    def single(x):
        return np.float32(x).astype(np.float64) if inside else np.float32(x)

    def called(wo, x):
        if inside:
            return function(single(wo), single(x))
        found = function(wo, x)
        return tuple(map(single, found)) if isinstance(found, tuple) else single(found)

    return called


@pytest.mark.parametrize("which", [(0,), (1,), (2,), (0, 1, 2)])
@pytest.mark.parametrize("inside", [False, True])
def test_rounding_of_any_of_the_functions_is_no_mistake(metal, which, inside):
    """float32 in one of them is enough to make weight times density another number."""
    functions = [metal.evaluate, metal.sample, metal.pdf]
    for k in which:
        functions[k] = rounded(functions[k], inside)
    assert failed(*functions, precision="float32" if inside else None) == []
    if inside:  # which the arrays do not say
        assert not weights(*functions)


@pytest.mark.parametrize(
    ("mistake", "seen"),
    [
        ("no Jacobian", {"chi_square", "weights"}),
        ("one side's shadows", {"weights", "furnace", "reciprocity"}),
        ("failed draws count", {"chi_square", "furnace"}),
    ],
)
def test_mistakes_of_the_example(metal, mistake, seen):
    functions = [
        lambda wo, x, f=f: f(wo, x, mistake) for f in (metal.evaluate, metal.sample, metal.pdf)
    ]
    assert set(failed(*functions)) == seen


def test_every_mistake_is_seen(metal):
    half = lambda wo, wi: 0.5 * floor_pdf(wo, wi)  # noqa: E731
    uniform = lambda wo, wi: np.where(wi[:, 2] > 0, 0.5 / math.pi, 0.0)  # noqa: E731
    bright = lambda wo, wi: 1.3 * floor(wo, wi)  # noqa: E731
    tilted = lambda wo, wi: floor(wo, wi) * wo[:, 2]  # noqa: E731
    flat = lambda wo, wi: floor(wo, wi) / np.maximum(wi[:, 2], 1e-9)  # noqa: E731
    negative = lambda wo, wi: floor(wo, wi) - 1e-3  # noqa: E731
    nan = lambda wo, wi: np.where(wi[:, 2] > 0.9, np.nan, floor(wo, wi))  # noqa: E731
    dark = lambda wo, u: (floor_sample(wo, u)[0], np.full(len(u), 0.79))  # noqa: E731
    crowded = lambda wo, u: floor_sample(wo, np.column_stack([u[:, 0] ** 1.05, u[:, 1]]))  # noqa: E731
    turned = lambda wo, u: floor_sample(wo, np.column_stack([u[:, 0], 0.98 * u[:, 1]]))  # noqa: E731
    below = lambda wo, u: (floor_sample(wo, u)[0] * (1, 1, -1), np.full(len(u), 0.8))  # noqa: E731
    planted = {
        "half the density": ((floor, floor_sample, half), {"chi_square", "weights"}),
        "a uniform density": ((floor, floor_sample, uniform), {"chi_square", "weights"}),
        "too bright": ((bright, floor_sample, floor_pdf), {"weights", "furnace"}),
        "one side's cosine": ((tilted, floor_sample, floor_pdf), {"weights", "furnace", BOTH}),
        "no cosine": ((flat, floor_sample, floor_pdf), {"weights", "furnace", BOTH}),
        "negative values": ((negative, floor_sample, floor_pdf), {"weights", "furnace"}),
        "not a number": ((nan, floor_sample, floor_pdf), {"weights", "furnace", BOTH}),
        "weights of another albedo": ((floor, dark, floor_pdf), {"weights", "furnace"}),
        "crowded draws": ((floor, crowded, floor_pdf), {"chi_square"}),
        "a slice without draws": ((floor, turned, floor_pdf), {"chi_square"}),
        "draws below": ((floor, below, floor_pdf), {"chi_square"}),
    }  # fmt: skip
    for name, (functions, seen) in planted.items():
        assert set(failed(*functions)) >= seen, name


def test_glass_by_its_index():
    """Values of radiance: another index is no reciprocal material, and creates light."""
    glass = examples(Dielectric)[0].model_dump()
    scene = Scene(
        camera=Perspective(eye=(0, 0, 4), target=(0, 0, 0), fov=20),
        materials={"glass": {"type": "rough_dielectric", "alpha": 0.3, "interior_ior": 1.5,
                             "exterior_ior": glass["exterior_ior"]}},
        shapes=(Sphere(material="glass"),),
        lights=(Constant(radiance=1.0),),
    )  # fmt: skip
    bsdf = scene.bsdf("glass")
    eta = 1.5 / glass["exterior_ior"]
    assert reciprocity(bsdf.evaluate, eta=eta)
    assert furnace(bsdf.evaluate, eta=eta)
    wrong = reciprocity(bsdf.evaluate, eta=1.001 * eta)
    assert not wrong
    assert "1.002" in wrong.reason or "0.998" in wrong.reason  # the square
    assert not furnace(bsdf.evaluate, eta=1.05 * eta)


def test_samplers_without_views():
    right = lambda u: np.sqrt(u[:, :2])  # noqa: E731
    density = lambda x: 4.0 * x[:, 0] * x[:, 1]  # noqa: E731
    assert chi_square(right, density, domain="square")
    assert not chi_square(lambda u: right(u) ** 1.1, density, domain="square")
    sky = lambda u: floor_sample(None, u)[0]  # noqa: E731
    assert chi_square(sky, lambda wi: np.maximum(wi[:, 2], 0.0) / math.pi)
    found = chi_square(sky, lambda wi: np.where(wi[:, 2] > 0, 0.5 / math.pi, 0.0))
    assert not found
    assert "not distributed as the density says" in found.reason
    nothing = lambda u: np.full((len(u), 3), np.nan)  # noqa: E731
    assert chi_square(nothing, lambda wi: np.zeros(len(wi)))
    lost = chi_square(nothing, lambda wi: np.maximum(wi[:, 2], 0.0) / math.pi)
    assert not lost
    assert "every draw failed" in lost.reason


def test_false_alarms():
    """The stated chance is one in a million: none of 80 checks of right functions fails."""
    assert all(chi_square(floor_sample, floor_pdf, views=(0, 0, 1), seed=k) for k in range(40))
    assert all(furnace(floor, floor_sample, views=(0.6, 0, 0.8), seed=k) for k in range(40))


def test_pictures_show_what_is_wrong(tmp_path):
    found = chi_square(
        floor_sample, lambda wo, wi: np.where(wi[:, 2] > 0, 0.5 / math.pi, 0), views=(0, 0, 1)
    )
    titles = [title for title, _ in found.maps]
    assert titles == ["drawn", "by the density", "difference, standard deviations"]
    drawn, said, apart = (values for _, values in found.maps)
    assert drawn.sum() == pytest.approx(1 << 15)
    assert said.sum() == pytest.approx(1 << 15, rel=1e-3)
    assert apart[0].mean() > 4  # more upwards than the density says
    assert apart[14].mean() < -4
    found.write_picture(tmp_path / "found.png")
    assert (tmp_path / "found.png").stat().st_size > 1000
    with pytest.raises(UsageError, match="there is no picture of this"):
        reciprocity(floor).write_picture(tmp_path / "none.png")


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: reciprocity(lambda wo, wi: 1.0), r"got an array \(\).*expected \(4096,\)"),
        (lambda: chi_square(lambda u: u, lambda x: x[:, 0]), "a direction of length .*expected 1"),
        (lambda: chi_square(lambda u: u[:, :2], lambda x: x[:, 0]), r"expected \(32768, 3\)"),
        (lambda: weights(floor, lambda wo, u: floor_sample(wo, u)[0], floor_pdf), "wi, weight"),
        (lambda: furnace(floor, views=(0, 1)), "expected directions"),
        (lambda: furnace(floor, views=(0, np.nan, 1)), "expected directions"),
        (lambda: furnace(floor, views=np.zeros((0, 3))), "expected directions"),
        (lambda: furnace(floor, views=(0, 0, 0)), "length 0"),
        (lambda: furnace(floor, eta=-1.5), "eta: got -1.5"),
        (lambda: reciprocity(floor, eta=math.nan), "eta: got nan"),
        (lambda: reciprocity(floor, precision="int32"), "expected a type of floats"),
        (lambda: reciprocity(floor, precision="float33"), "expected a type of floats"),
        (lambda: chi_square(floor_sample, floor_pdf, views=(0, 0, 1), draws=100), "draws: got 100"),
        (lambda: chi_square(floor_sample, floor_pdf, domain="sphere"), "domain: got 'sphere'"),
    ],
)  # fmt: skip
def test_wrong_arrays(call, told):
    with pytest.raises(UsageError, match=told):
        call()


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_value_that_is_not_finite_is_told(value):
    def wrong(of):
        return lambda wo, wi: np.where(wi[:, 2] < 0.1, value, of(wo, wi))

    found = chi_square(floor_sample, wrong(floor_pdf), views=(0, 0, 1))
    assert f"the density is {value} at [" in found.reason
    assert f"a value is {value}" in furnace(wrong(floor)).reason
    assert not found


def test_draws_beyond_the_square_are_told():
    found = chi_square(lambda u: 2.0 * u[:, :2], lambda x: np.full(len(x), 0.25), domain="square")
    assert "draws are beyond the square" in found.reason
    assert not found


def test_few_draws_of_a_right_sampler_pass():
    some = [chi_square(floor_sample, floor_pdf, views=(0, 0, 1), draws=FEWEST, seed=k)
            for k in range(40)]  # fmt: skip
    assert all(some)


def test_the_public_module():
    from comparisons import testing
    from comparisons.testing import check_material as found

    assert found is check_material
    assert {"check_material", "chi_square", "furnace", "reciprocity", "weights"} <= {*dir(testing)}
    assert {"compare", "gate", "gate_derivative", "gate_pair", "testing"} <= {*dir(comparisons)}


def test_the_fixture(material_gate, tmp_path, monkeypatch):
    monkeypatch.setattr(material_gate, "_out", tmp_path)
    assert len(material_gate(floor, floor_sample, floor_pdf)) == 4
    with pytest.raises(
        pytest.fail.Exception, match=r"material_gate: chi_square: seen at 26 degrees"
    ) as told:
        material_gate(floor, floor_sample, lambda wo, wi: np.where(wi[:, 2] > 0, 0.5 / math.pi, 0))
    assert "weights.png" in str(told.value)
    assert len(list(tmp_path.rglob("*.png"))) == 2


def test_a_sheen_that_creates_light_is_seen():
    """Disney's is added to the other lobes: seen at 83 degrees 1.0096 of red light leaves."""
    cloth = next(m for m in examples(Principled) if m.sheen)
    scene = Scene(
        camera=Perspective(eye=(0, 0, 4), target=(0, 0, 0), fov=20),
        materials={"cloth": cloth},
        shapes=(Sphere(material="cloth"),),
        lights=(Constant(radiance=1.0),),
    )
    found = furnace(scene.bsdf("cloth").evaluate)
    assert not found
    assert "1.009" in found.reason
