"""The rung `sampling` of materials: every type agrees, and each planted fault of every type's
density is seen."""

import math
from dataclasses import replace

import numpy as np
import pytest
from builders import SCENES

from comparisons.rungs.sampling import materials
from comparisons.rungs.sampling.materials import (
    CAREFUL,
    FAMILY,
    QUICK,
    SUSPICIOUS,
    OfTables,
    of_view,
    views_of,
)
from reference_rt.core.model import name_of, types_of
from reference_rt.integrators import Direct
from reference_rt.materials import AnyMaterial, Bsdf, Emissive, NoSurface
from reference_rt.rendering.scene import Scene
from reference_rt.scene.examples import NAMED, examples, write_files

TYPES = [of for of in types_of(AnyMaterial) if of not in (Emissive, NoSurface)]
LEAVES = list(types_of(Bsdf))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("examples")
    write_files(path)
    return path


def scene_of(found, folder):
    """A scene of materials alone, in a folder with the files that examples name."""
    named = {"textures": NAMED["textures"], "materials": NAMED["materials"] | found}
    scene = Scene(**named, integrator=Direct())
    scene._folder = folder
    return scene


def checked(scene, number=None, plant=OfTables, seed=5):
    """What the rung says of a scene's materials, or of one, of which `plant` makes the BSDF."""
    tables = scene.tables

    def of(view):
        is_planted = view.number == number
        return (plant if is_planted else OfTables)(tables, view.number)

    return materials.check(scene, tables, of, seed)


@pytest.mark.cases(5)
@pytest.mark.parametrize("of", TYPES, ids=name_of)
def test_every_type_agrees(of, folder):
    found = {f"example {k}": example for k, example in enumerate(examples(of))}
    result = checked(scene_of(found, folder))
    assert result.status == "agree", result.reason
    assert "narrow" not in result.reason


# ---- faults -------------------------------------------------------------------------------------


class Claims(OfTables):
    """A material that draws as ever, but claims another density, with weights that fit it: what
    renderers do whose `sample` and `pdf` share a mistake."""

    delta = 1.0
    """The factor on the probabilities of perfect lobes."""

    def claimed(self, wo, wi, density, place):
        return density

    def pdf(self, wo, wi, *place):
        return self.claimed(wo, wi, super().pdf(wo, wi, *place), place)

    def sample(self, wo, u, *place):
        drawn = super().sample(wo, u, *place)
        claimed = self.claimed(wo, drawn.wi, drawn.pdf, place)
        claimed = np.where(drawn.is_delta, self.delta * drawn.pdf, claimed)
        claimed = np.where(drawn.pdf > 0, claimed, 0.0)
        with np.errstate(all="ignore"):
            weight = drawn.weight * np.nan_to_num(drawn.pdf / claimed)[:, None]
        return replace(drawn, pdf=claimed, weight=weight)


class TooLarge(Claims):
    delta = 1.02

    def claimed(self, wo, wi, density, place):
        return 1.02 * density


class OtherLobes(OfTables):
    """Lobes are chosen with other probabilities than are claimed."""

    def sample(self, wo, u, *place):
        return super().sample(wo, u * np.where([True, False, False], u, 1.0), *place)


class WithoutJacobian(Claims):
    """The density of half vectors in place of that of reflected directions."""

    def claimed(self, wo, wi, density, place):
        half = wo + wi
        cosine = np.abs(half @ wo) / np.maximum(np.linalg.norm(half, axis=1), 1e-12)
        return np.where(wi[:, 2] * wo[2] > 0, 4.0 * cosine * density, density)


class WithoutEta(Claims):
    """The density of refracted directions without eta²."""

    def claimed(self, wo, wi, density, place):
        eta = 1.5 if wo[2] > 0 else 1.0 / 1.5
        return np.where(wi[:, 2] * wo[2] > 0, density, density / eta**2)


class UniformAsCosine(Claims):
    """What is claimed is a density over the hemisphere that is not the one that is drawn."""

    def claimed(self, wo, wi, density, place):
        uniform = 0.5 / math.pi
        return np.where(density > 0, uniform, 0.0)


class CosineAsUniform(Claims):
    def claimed(self, wo, wi, density, place):
        return np.where(density > 0, np.abs(wi[:, 2]) / math.pi, 0.0)


def rougher(of_wrong):
    """The density of another roughness: of the material `of_wrong`."""

    class Rougher(Claims):
        def claimed(self, wo, wi, density, place):
            other = OfTables(self._tables, of_wrong).pdf(wo, wi, *place)
            return np.where(density > 0, other, 0.0)

    return Rougher


BASE = {
    "conductor": {"eta": 0.2, "k": 3.0},
    "rough_conductor": {"eta": 0.2, "k": 3.0, "alpha": 0.3},
    "rough_dielectric": {"alpha": 0.3},
    "rough_plastic": {"alpha": 0.3},
    "principled": {"roughness": 0.5, "spec_trans": 0.4, "metallic": 0.2, "clearcoat": 0.5},
    "principled_thin": {"roughness": 0.5, "spec_trans": 0.5, "diff_trans": 0.6},
    "gltf_pbr": {"roughness": 0.5, "metallic": 0.4},
    "phong": {"diffuse": 0.2, "specular": 0.3, "mirror": 0.2, "exponent": 12.0},
}
"""A material of each type with all its lobes."""

OTHER = {
    "rough_conductor": {"alpha": 0.33},
    "rough_dielectric": {"alpha": 0.33},
    "rough_plastic": {"alpha": 0.33},
    "principled": {"roughness": 0.53},
    "principled_thin": {"roughness": 0.53},
    "gltf_pbr": {"roughness": 0.53},
    "phong": {"exponent": 14.0},
}
"""A little rougher, or smoother."""

SMOOTH = [name_of(of) for of in LEAVES if of.smooth]
MICROFACETS = [name for name in OTHER if name != "phong"]
ONE_LOBE = ("diffuse", "mirror", "conductor", "rough_conductor")
LOBES = [name_of(of) for of in LEAVES if name_of(of) not in ONE_LOBE]
FAULTS = {
    "2 % too large": (TooLarge, [name_of(of) for of in LEAVES]),
    "another roughness": (None, list(OTHER)),
    "lobes chosen otherwise": (OtherLobes, LOBES),
    "no half vector's Jacobian": (WithoutJacobian, MICROFACETS),
    "no eta squared": (WithoutEta, ["rough_dielectric"]),
    "uniform for a cosine": (UniformAsCosine, SMOOTH),
    "a cosine for its own": (CosineAsUniform, [name for name in SMOOTH if name != "diffuse"]),
}
CASES = [(fault, name) for fault, (_, names) in FAULTS.items() for name in names]


@pytest.mark.cases(14)
@pytest.mark.parametrize(("fault", "name"), CASES)
def test_faults_of_every_type_are_seen(fault, name):
    fields = {"type": name} | BASE.get(name, {})
    scene = Scene(materials={"it": fields, "other": fields | OTHER.get(name, {})})
    plant = FAULTS[fault][0] or rougher(1)
    found = checked(scene, 0, plant)
    assert found.status == "differ", fault
    assert "'it'" in found.reason


# ---- false alarms -------------------------------------------------------------------------------


def materials_of_scenes():
    """Scenes whose materials are all of the project's scenes, each once: (file, tables, views)."""
    seen = set()
    for path in sorted(SCENES.rglob("*.yaml")):
        scene = Scene.load(path)
        described = scene.model_dump_json(include={"textures"})
        new = {
            name
            for name, material in scene.materials.items()
            if (key := (material.model_dump_json(), described)) not in seen and not seen.add(key)
        }
        views = [view for view in views_of(scene, scene.tables) if view.name in new]
        if views:
            yield path, scene.tables, views


SEEDS = 2
"""A minute of a core each.  Ten were counted once: docs/verdict.md."""


@pytest.mark.slow
def test_right_materials_of_all_scenes_agree():
    """How often the quick look suspects a right view, and the whole rung calls it different."""
    count, suspected, found = 0, 0, []
    for path, tables, views in materials_of_scenes():
        for view in views:
            bsdf = OfTables(tables, view.number)
            for seed in range(SEEDS):
                count += 1
                if of_view(bsdf, view, QUICK, SUSPICIOUS, (1000 + seed,)):
                    suspected += 1
                    level = FAMILY / len(views)
                    if fault := of_view(bsdf, view, CAREFUL, level, (1000 + seed, 1)):
                        found.append(f"{path.stem}: {view}: {fault}")
    print(f"{suspected} of {count} views suspected, {len(found)} called different")
    assert found == []
    # Three tests a view, each of which suspects SUSPICIOUS of the right ones, or fewer.
    assert suspected <= 3 * SUSPICIOUS * count
