"""Materials that are made of others: what their parts must add up to."""

import math

import numpy as np
import pytest
from builders import U

import reference_rt as rt
from reference_rt import materials as any_material
from reference_rt.core.ray import SurfacePoint
from reference_rt.core.vec3 import Frame, Vec3, length
from reference_rt.materials import Shading
from reference_rt.materials.textured import evaluate_textures
from reference_rt.shapes.shape import Tangents
from reference_rt.textures import At
from reference_rt.textures.lookup import lookup

X, Y, Z = Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0)
LEAVES = {
    "red": rt.Diffuse(reflectance=(0.8, 0.1, 0.1)),
    "blue": rt.Diffuse(reflectance=(0.1, 0.2, 0.9)),
    "silver": rt.Mirror(reflectance=(0.9, 0.9, 0.8)),
    "glass": rt.Dielectric(),
}
CHECKER = rt.Checker(first=(0.25, 0.25, 0.25), second=(0.75, 0.75, 0.75))


def tables_of(**materials):
    """The tables of a scene with these materials besides LEAVES, and the rows by name."""
    scene = rt.Scene(
        textures={"checker": CHECKER},
        materials=LEAVES | materials,
        shapes=(rt.Sphere(material="red"),),
    )
    return rt.build_tables(scene), {name: k for k, name in enumerate(scene.materials)}


def shading(tables, m, wo, u=0.1, v=0.1):
    point = SurfacePoint(Vec3(0.0, 0.0, 0.0), Z, Z, 0.0, m, -1)
    at = At(tables.textures, u, v, Vec3(-1.0, -1.0, -1.0))
    kept = np.zeros(any_material.scratch_floats(tables.materials))
    place = Shading(point, Frame(X, Y, Z), wo, at, Tangents(X, Y), kept)
    any_material.prepare(tables.materials, place, at)
    return place


def towards(theta, phi):
    return Vec3(math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta))


def evaluate(tables, m, wo, wi, **place):
    return np.array(any_material.evaluate(tables.materials, shading(tables, m, wo, **place), wi))


def sampled(tables, m, wo, u_lobe, u0=0.3, u1=0.6, **place):
    place = shading(tables, m, wo, **place)
    return any_material.sample(tables.materials, place, u_lobe, u0, u1)


WO, WI = towards(0.7, 0.4), towards(1.1, 2.9)


def test_a_blend_is_the_weighted_sum():
    tables, row = tables_of(
        inner=rt.Blend(first="red", second="blue", weight=0.25),
        outer=rt.Blend(first="inner", second="blue", weight=0.5),
    )
    red, blue = (evaluate(tables, row[name], WO, WI) for name in ("red", "blue"))
    # Two products and a sum each.
    inner, outer = (evaluate(tables, row[name], WO, WI) for name in ("inner", "outer"))
    assert np.allclose(inner, 0.75 * red + 0.25 * blue, rtol=8 * U, atol=0)
    assert np.allclose(outer, 0.375 * red + 0.625 * blue, rtol=8 * U, atol=0)


def test_a_blends_weight_may_be_a_texture():
    tables, row = tables_of(mixed=rt.Blend(first="red", second="blue", weight="checker"))
    red, blue = (evaluate(tables, row[name], WO, WI) for name in ("red", "blue"))
    for u, weight in ((0.1, 0.25), (0.6, 0.75)):
        found = evaluate(tables, row["mixed"], WO, WI, u=u, v=0.1)
        assert np.allclose(found, (1 - weight) * red + weight * blue, rtol=8 * U, atol=0)


def test_any_layer_may_draw_what_all_weigh():
    """Whichever is drawn, the weight is that of the whole mixture."""
    tables, row = tables_of(mixed=rt.Blend(first="red", second="blue", weight=0.25))
    for u_lobe in (0.1, 0.74, 0.76, 0.99):
        drawn = sampled(tables, row["mixed"], WO, u_lobe)
        value = evaluate(tables, row["mixed"], WO, drawn.wi)
        place = shading(tables, row["mixed"], WO)
        assert drawn.pdf == any_material.pdf(tables.materials, place, drawn.wi)
        assert np.allclose(np.array(drawn.weight) * drawn.pdf, value, rtol=8 * U, atol=0)


@pytest.mark.parametrize("opacity", [0.0, 0.3, 1.0])
def test_a_mask_lets_light_pass(opacity):
    tables, row = tables_of(leaf=rt.Mask(base="red", opacity=opacity))
    red = evaluate(tables, row["red"], WO, WI)
    assert np.allclose(evaluate(tables, row["leaf"], WO, WI), opacity * red, rtol=4 * U, atol=0)
    passed = 0
    for u_lobe in (np.arange(1000) + 0.5) / 1000:
        drawn = sampled(tables, row["leaf"], WO, u_lobe)
        if drawn.is_delta:
            passed += 1
            assert drawn.wi == -WO
            assert drawn.eta == 1.0
            assert np.allclose(drawn.weight, 1.0, rtol=4 * U)
        else:
            assert np.allclose(drawn.weight, LEAVES["red"].reflectance, rtol=8 * U)
    assert passed == round(1000 * (1 - opacity))


def test_what_a_mask_hides_from_behind_still_passes():
    tables, row = tables_of(leaf=rt.Mask(base="red", opacity=0.3))
    behind = -WO
    assert sampled(tables, row["leaf"], behind, 0.2).pdf == 0.0  # its base is black there
    assert sampled(tables, row["leaf"], behind, 0.5).wi == WO


def mirrored(w):
    return Vec3(w.x, w.y, -w.z)


def test_two_sides_alike():
    tables, row = tables_of(paper=rt.TwoSided(base="red"))
    front = evaluate(tables, row["red"], WO, WI)
    assert (evaluate(tables, row["paper"], WO, WI) == front).all()
    assert (evaluate(tables, row["paper"], mirrored(WO), mirrored(WI)) == front).all()
    assert not evaluate(tables, row["paper"], WO, mirrored(WI)).any()
    drawn = sampled(tables, row["paper"], mirrored(WO), 0.5)
    assert drawn.wi.z < 0.0
    assert np.allclose(drawn.weight, LEAVES["red"].reflectance, rtol=4 * U)


def test_two_sides_unlike():
    tables, row = tables_of(paper=rt.TwoSided(base="red", back="silver"))
    front = evaluate(tables, row["red"], WO, WI)
    assert (evaluate(tables, row["paper"], WO, WI) == front).all()
    assert not evaluate(tables, row["paper"], mirrored(WO), mirrored(WI)).any()
    drawn = sampled(tables, row["paper"], mirrored(WO), 0.5)
    assert drawn.is_delta
    assert drawn.wi == Vec3(-WO.x, -WO.y, -WO.z)
    assert tuple(drawn.weight) == LEAVES["silver"].reflectance


def test_the_mean_weight_is_the_integral():
    """Of a mixture of a diffuse and a perfect part, over the unit cube of its numbers."""
    tables, row = tables_of(
        lacquer=rt.Blend(first="red", second="silver", weight=0.4),
        worn=rt.Mask(base="lacquer", opacity=0.5),
    )
    red, silver = np.array(LEAVES["red"].reflectance), np.array(LEAVES["silver"].reflectance)
    lacquer = 0.6 * red + 0.4 * silver
    for name, expected in {"lacquer": lacquer, "worn": 0.5 * lacquer + 0.5}.items():
        numbers = (np.arange(100) + 0.5) / 100
        weights = [sampled(tables, row[name], WO, u_lobe).weight for u_lobe in numbers]
        assert np.mean(weights, axis=0) == pytest.approx(expected, rel=1e-13)


def test_branches_are_those_of_the_layers():
    tables, row = tables_of(
        pane=rt.Blend(first="glass", second="silver", weight=0.25),
        holed=rt.Mask(base="pane", opacity=0.5),
    )
    materials = tables.materials
    place = shading(tables, row["holed"], WO)
    count = any_material.branch_count(materials, row["holed"])
    assert count == 3 == any_material.most_branches(materials)
    found = [any_material.branches(materials, place, k) for k in range(count)]
    glass = any_material.branches(materials, shading(tables, row["glass"], WO), 0)
    assert found[0].refracted == glass.refracted
    assert found[0].transmittance.x == pytest.approx(0.375 * glass.transmittance.x, rel=4 * U)
    assert found[1].reflectance.x == pytest.approx(0.125 * 0.9, rel=4 * U)
    assert found[2].refracted == -WO
    assert found[2].transmittance == (0.5, 0.5, 0.5)


def test_a_tilted_normal():
    """A constant normal map tilts the frame: Lambert's cosine is that to the tilted normal, and
    what it takes to the other side of the surface is dark."""
    tilt = 0.3
    colour = (0.5 * (1 + math.sin(tilt)), 0.5, 0.5 * (1 + math.cos(tilt)))
    scene = rt.Scene(
        textures={"slope": rt.Checker(first=colour, second=colour)},
        materials=LEAVES | {"tilted": rt.NormalMap(base="red", normals="slope")},
        shapes=(rt.Sphere(material="tilted"),),
    )
    tables = rt.build_tables(scene)
    m = list(scene.materials).index("tilted")
    n = Vec3(math.sin(tilt), 0.0, math.cos(tilt))
    value = evaluate(tables, m, WO, WI)
    cosine = WI.x * n.x + WI.z * n.z
    assert value == pytest.approx(np.array([0.8, 0.1, 0.1]) * cosine / math.pi, rel=1e-14)
    low = towards(math.pi / 2 + 0.1, 0.0)  # in front of the tilted normal, behind the surface
    assert not evaluate(tables, m, WO, low).any()
    drawn = sampled(tables, m, WO, 0.5)
    assert length(drawn.wi) == pytest.approx(1.0, rel=8 * U)


@pytest.mark.parametrize(
    ("materials", "message"),
    [
        ({"a": rt.Blend(first="b", second="red"), "b": rt.Mask(base="a")}, "contains itself"),
        ({"a": rt.TwoSided(base="glass")}, "'glass' lets light pass"),
        ({"a": rt.TwoSided(base="b"), "b": rt.Mask(base="red")}, "'b' lets light pass"),
        ({"a": rt.Mask(base="nothing")}, "no material 'nothing'"),
        ({"a": rt.Mask(base="red", opacity="clouds")}, "no texture 'clouds'"),
        (
            {
                "a": rt.NormalMap(base="b", normals="checker"),
                "b": rt.NormalMap(base="red", normals="checker"),
            },
            "'b' is tilted already",
        ),
        (
            {"m0": rt.Blend(first="red", second="blue")}
            | {f"m{k}": rt.Blend(first=f"m{k - 1}", second=f"m{k - 1}") for k in range(1, 7)},
            "has 128 layers; expected at most 64",
        ),
    ],
)
def test_what_cannot_be_a_material(materials, message):
    with pytest.raises(rt.SceneError, match=message):
        tables_of(**materials)


def test_a_materials_textures_are_those_of_all_that_it_is_made_of():
    scene = rt.Scene(
        textures={
            name: rt.Checker(first=(value,) * 3, second=(value,) * 3)
            for name, value in (("a", 0.1), ("b", 0.2), ("c", 0.3), ("d", 0.4))
        },
        materials={
            "plain": rt.Diffuse(reflectance=(0.5, 0.5, 0.5)),
            "inner": rt.Diffuse(reflectance="c"),
            "bumpy": rt.Bump(base="inner", height="b"),
            "mixed": rt.Blend(first="bumpy", second="inner", weight="a"),
            "lamp": rt.Emissive(radiance="d", base="mixed"),
        },
        shapes=(rt.Sphere(material="lamp"),),
    )
    tables = rt.build_tables(scene)
    textured = tables.materials.textured
    found = [
        textured.texture[first : first + number].tolist()
        for first, number in zip(textured.first, textured.number, strict=True)
    ]
    # Of heights, slopes are asked instead of colours.
    assert found == [[], [2], [2], [0, 2], [0, 2, 3]]
    at, colours = At(tables.textures, 0.3, 0.6, Vec3(-1.0, -1.0, -1.0)), np.full(12, np.nan)
    looked = evaluate_textures(textured, 4, at, colours)
    for k in (0, 2, 3):
        assert lookup(k, looked) == lookup(k, at)
    assert np.isnan(colours[3:6]).all()
