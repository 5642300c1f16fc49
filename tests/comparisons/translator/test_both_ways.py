"""Lights, filters, samplers and integrators, as they are written for Mitsuba and read again: in
memory and in scene files.  Defaults of what is read are Mitsuba's own."""

import re
import warnings
from collections.abc import Iterable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from builders import SCENES
from exr_writer import exr

import reference_rt as rt
from comparisons.cameras import CAMERAS
from comparisons.cameras.film import FILTERS, translate_filter
from comparisons.cameras.samplers import translate_sampler
from comparisons.integrators import INTEGRATORS, translate_integrator
from comparisons.integrators.ray_cast import LAYERS
from comparisons.lights import LIGHTS, translate_light
from comparisons.mitsuba.backend import mitsuba, scalar
from comparisons.mitsuba.context import NO_CONTEXT
from comparisons.translator import to_mitsuba
from comparisons.translator.reading import read_dict
from comparisons.translator.writing import write_xml
from reference_rt.cameras import AnyCamera
from reference_rt.cameras.film import AnyFilter, Film
from reference_rt.core.model import types_of
from reference_rt.integrators import AnyIntegrator
from reference_rt.lights import AnyLight
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import AnySampler
from reference_rt.scene.examples import NAMED, examples, write_files
from reference_rt.shapes import Sphere
from reference_rt.textures.image_file import read_image
from reference_rt.util.errors import SceneWarning

LIGHT_EXAMPLES = examples(AnyLight)
FILTER_EXAMPLES = examples(AnyFilter)
INTEGRATOR_EXAMPLES = [
    one
    for one in examples(AnyIntegrator)
    # No plugin of Mitsuba has one strategy alone, leaves shadows out, or caustics of points.
    if getattr(one, "sampling", "both") == "both"
    and getattr(one, "shadows", True)
    and getattr(one, "caustics_of_points", True)
]
SAMPLER_EXAMPLES = examples(AnySampler)


@pytest.mark.parametrize(
    ("known", "union"),
    [
        (LIGHTS, AnyLight),
        (CAMERAS, AnyCamera),
        (FILTERS, AnyFilter),
        (INTEGRATORS, AnyIntegrator),
    ],
    ids=["lights", "cameras", "filters", "integrators"],
)
def test_every_type_is_known(known: Iterable[Any], union: Any) -> None:
    assert {one.description for one in known} == set(types_of(union))


# ---- files ---------------------------------------------------------------------------------------


def through_file(folder: Path, **parts: Any) -> Scene:
    write_files(folder)
    scene = Scene(textures=NAMED["textures"], shapes=(Sphere(),)).changed(**parts)
    scene._folder = folder
    write_xml(scene, folder / "scene.xml")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)  # where nothing is hit Mitsuba has distance 0
        return Scene.load(folder / "scene.xml")


@pytest.mark.parametrize("kind", ["chroma", "deep", "layer", "npy"])
@pytest.mark.filterwarnings("ignore:.*has deep pixels")
def test_images_that_mitsuba_reads_otherwise(kind: str, tmp_path: Path) -> None:
    """They are written as plain ones: Mitsuba shows what we do."""
    rng, name = np.random.default_rng(3), f"a.{'npy' if kind == 'npy' else 'exr'}"
    planes = rng.uniform(0.1, 0.5, (3, 4, 6)).astype(np.float32)
    if kind == "npy":
        np.save(tmp_path / name, planes.transpose(1, 2, 0))
    elif kind == "deep":
        deep = {c: np.empty((4, 6), object) for c in "RGB"}
        settings = {"type": OpenEXR.deepscanline, "compression": OpenEXR.NO_COMPRESSION}
        for c, at in product("RGB", np.ndindex(4, 6)):
            deep[c][at] = np.array([planes["RGB".index(c)][at], 9.0], np.float32)
        OpenEXR.File(settings, deep).write(str(tmp_path / name))
    elif kind == "chroma":
        half = {c: planes[k, ::2, ::2].copy() for k, c in ((1, "RY"), (2, "BY"))}
        (tmp_path / name).write_bytes(exr({"Y": planes[0], **half}, {"RY": 2, "BY": 2}))
    else:
        layers = {f"{p}.{c}": planes[k] * (p == "b") for p in "ab" for k, c in enumerate("RGB")}
        (tmp_path / name).write_bytes(exr({n: p.astype("<f4") for n, p in layers.items()}))
    layer = "b" if kind == "layer" else ""
    expected = read_image(tmp_path / name, "auto", layer=layer)
    scene = Scene(
        textures={"t": rt.Bitmap(file=name, layer=layer)},
        materials={"m": rt.Diffuse(reflectance="t")},
        shapes=(Sphere(material="m"),),
        lights=(rt.EnvironmentMap(file=name, layer=layer),),
    )
    scene._folder = tmp_path
    write_xml(scene, tmp_path / "scene.xml")
    files = re.findall(r'name="filename" value="([^"]*)"', (tmp_path / "scene.xml").read_text())
    assert len(files) == 2
    for file in files:
        found = np.array(mitsuba().Bitmap(str(tmp_path / file)))
        assert np.abs(found - expected).max() < 1e-6


def same(a: Any, b: Any) -> bool:
    """Whether tables hold the same numbers."""
    if isinstance(a, tuple):
        return type(a) is type(b) and all(map(same, a, b))
    return bool(np.array_equal(a, b))


@pytest.mark.parametrize("light", LIGHT_EXAMPLES, ids=lambda light: light.type)
def test_lights_in_files(light: Any, tmp_path: Path) -> None:
    """They are built to the same tables: a width, or a rotation, may be said in other words."""
    scene = through_file(tmp_path, lights=(light,), integrator=rt.Whitted())
    (again,) = scene.lights
    assert type(again) is type(light)
    named = Scene(lights=(light,), textures=NAMED["textures"], shapes=(Sphere(),))
    named._folder = tmp_path
    assert same(named.tables.lights, scene.tables.lights)


@pytest.mark.parametrize("film_filter", FILTER_EXAMPLES, ids=lambda one: one.type)
def test_filters_in_files(film_filter: AnyFilter, tmp_path: Path) -> None:
    film = Film(width=5, height=7, filter=film_filter, layers=tuple(LAYERS))
    assert through_file(tmp_path, film=film).film == film


@pytest.mark.parametrize("integrator", INTEGRATOR_EXAMPLES, ids=str)
def test_integrators_in_files(integrator: Any, tmp_path: Path) -> None:
    assert through_file(tmp_path, integrator=integrator).integrator == integrator


@pytest.mark.parametrize("sampler", SAMPLER_EXAMPLES, ids=lambda one: one.type)
def test_samplers_in_files(sampler: Any, tmp_path: Path) -> None:
    integrator = rt.Whitted() if isinstance(sampler, rt.Grid) else rt.Path()
    found = through_file(tmp_path, sampler=sampler, integrator=integrator)
    assert found.resolved_sampler == sampler


# ---- memory --------------------------------------------------------------------------------------


def read(**parts: Any) -> Scene:
    return read_dict({"type": "scene", **parts}, Scene)


@pytest.mark.parametrize(
    "light",
    [x for x in LIGHT_EXAMPLES if type(x) in {one.description for one in LIGHTS if one.table}],
)
def test_lights_in_memory(light: Any) -> None:
    assert read(light=translate_light(light, NO_CONTEXT)).lights == (light,)


@pytest.mark.parametrize("film_filter", FILTER_EXAMPLES, ids=lambda one: one.type)
def test_filters_in_memory(film_filter: AnyFilter) -> None:
    film = {"type": "hdrfilm", "rfilter": translate_filter(film_filter)}
    assert read(sensor={"type": "perspective", "film": film}).film.filter == film_filter
    whole = to_mitsuba(Scene(film=Film(width=8, height=4, filter=film_filter)))
    mi_film = mitsuba().load_dict(whole).sensors()[0].film()
    # Our pixels sample the whole filter, also beyond the picture's edge.
    assert mi_film.sample_border() == (film_filter != rt.BoxFilter())


@pytest.mark.parametrize("integrator", INTEGRATOR_EXAMPLES, ids=str)
def test_integrators_in_memory(integrator: Any) -> None:
    found = translate_integrator(integrator)
    if found is None:  # the rung of geometry compares ray by ray
        assert isinstance(integrator, rt.RayCast)
    elif found["type"] != "whitted":  # ours: known to Mitsuba's parser in files alone
        assert read(integrator=found).integrator == integrator


@pytest.mark.parametrize("sampler", SAMPLER_EXAMPLES, ids=lambda one: one.type)
def test_samplers_in_memory(sampler: Any) -> None:
    """Independent ones for whatever is random."""
    integrator = {"type": "depth" if isinstance(sampler, rt.Grid) else "path"}
    view = {"type": "perspective", "sampler": translate_sampler(sampler)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SceneWarning)
        found = read(sensor=view, integrator=integrator).resolved_sampler
    wanted = rt.Grid if isinstance(sampler, rt.Grid) else rt.Independent
    assert found == wanted(spp=sampler.spp)


# ---- defaults ------------------------------------------------------------------------------------


def printed(plugin: dict[str, Any]) -> str:
    """A plugin in Mitsuba's words; white of one number and of three are the same."""
    with scalar() as mi:
        text = " ".join(str(mi.load_dict(plugin)).split())
    return re.sub(r"\w+Spectrum\[ ?value ?= ?\[?([\d.]+)[^]]*\]+( ?\])?", _white, text)


def _white(found: re.Match[str]) -> str:
    return f"white {float(found[1]):g}"


ALONE = {
    "radiancemeter": {},  # is read as another camera
    "view_rectangle": {},  # ours
    "goniometric": {},  # ours
    "sunsky": {},
    "envmap": {},  # needs a file
    "volpath": {},
    "volpathmis": {},
    "depth": {},
}  # fmt: skip


@pytest.mark.parametrize(
    "plugin", [p for one in LIGHTS for p in one.from_mitsuba if p not in ALONE]
)
def test_defaults_of_lights(plugin: str) -> None:
    (light,) = read(light={"type": plugin}).lights
    written = translate_light(light, NO_CONTEXT)
    assert written is not None
    ours, theirs = printed(written), printed({"type": plugin})
    if plugin == "spot":  # is turned about its axis
        ours, theirs = (re.sub(r"to_world = \[\[.*?\]\]", "", text) for text in (ours, theirs))
    assert ours == theirs


@pytest.mark.parametrize("plugin", [one.table.plugin for one in FILTERS])
def test_defaults_of_filters(plugin: str) -> None:
    film = {"type": "hdrfilm", "rfilter": {"type": plugin}}
    found = read(sensor={"type": "perspective", "film": film}).film.filter
    assert printed(translate_filter(found)) == printed({"type": plugin})


@pytest.mark.parametrize(
    "plugin", [p for one in INTEGRATORS for p in one.from_mitsuba if p not in ALONE]
)
def test_defaults_of_integrators(plugin: str) -> None:
    written = translate_integrator(read(integrator={"type": plugin}).integrator)
    assert written is not None
    assert printed(written) == printed({"type": plugin})


@pytest.mark.parametrize(
    "plugin", [p for one in CAMERAS for p in one.from_mitsuba if p not in ALONE]
)
def test_defaults_of_sensors(plugin: str) -> None:
    """Of film and sampler, too."""
    given = {"type": plugin} | ({"aperture_radius": 0.25} if plugin == "thinlens" else {})

    def numbers(sensor: dict[str, Any]) -> list[Any]:
        names = "x_fov|near_clip|far_clip|size|filter|sample_count|aperture_radius|focus_distance"
        text = printed(sensor)
        return re.findall(rf"\b({names}) = (\[.*?\]|\w+\[.*?\]|[-\d.e]+)", text)

    found = numbers(to_mitsuba(read(sensor=given))["sensor"])
    assert len(found) >= 5
    assert found == numbers(given)


@pytest.mark.parametrize("sampler", SAMPLER_EXAMPLES, ids=lambda one: one.type)
@pytest.mark.parametrize("has_media", [False, True])
def test_which_samplers_are_written(sampler: Any, has_media: bool) -> None:
    """Of those whose pictures have the right mean (`findings/mitsuba-ldsampler.sh` and
    `mitsuba-media-stratified.sh`), the one that is nearest to ours."""
    found = translate_sampler(sampler, in_file=True, has_media=has_media)["type"]
    if isinstance(sampler, rt.Grid):
        assert found == "stratified"  # without jitter: no random numbers
    else:
        is_spread = isinstance(sampler, rt.Sobol) and not has_media
        assert found == ("multijitter" if is_spread else "independent")


def test_media_are_seen_where_a_file_is_written(tmp_path: Path) -> None:
    for name, sampler in (("fog", "independent"), ("cornell_box", "multijitter")):
        write_xml(Scene.load(SCENES / f"{name}.yaml"), path := tmp_path / f"{name}.xml")
        assert f'<sampler type="{sampler}">' in path.read_text()
