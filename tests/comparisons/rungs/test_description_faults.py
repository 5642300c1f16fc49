"""Faults of validators and defaults, which both renderers share: the rung `files` names the place
and both values."""

import re
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import pytest
from faulty_sources import plant

from comparisons.compare.budget import Budget
from comparisons.compare.compare import Subject, compare_scene
from comparisons.experiments.selftest import SourceFault
from comparisons.rungs.files import files, misread
from reference_rt.cameras import Orthographic, Perspective, Pinhole, ThinLens
from reference_rt.cameras.film import Film, GaussianFilter
from reference_rt.integrators import Direct
from reference_rt.integrators import Path as PathTracing
from reference_rt.lights import Projector, Spot
from reference_rt.materials import Dielectric, Diffuse, GltfPbr, Mask, RoughConductor
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Sobol
from reference_rt.shapes import Cone, Cylinder, Polygon, Sphere, Torus
from reference_rt.shapes.csg import Difference, Intersection, Union
from reference_rt.textures import Checker, VertexColours
from reference_rt.textures.texture import UvMap

Planted = AbstractContextManager[None]
SOLIDS = (Union, Intersection, Difference)
HOLDERS = (Film, Checker, *SOLIDS, Scene)
"""What has other descriptions as fields."""


@contextmanager
def default(cls: Any, field: str, value: Any) -> Iterator[None]:
    """Another default of a field, in this process."""

    def build() -> None:
        for solid in SOLIDS:
            del solid.__pydantic_core_schema__  # it has the schemas of all shapes
        for one in dict.fromkeys((cls, *HOLDERS)):
            one.model_rebuild(force=True)

    info = cls.__pydantic_fields__[field]
    right = info.default
    try:
        info.default = value
        build()
        yield
    finally:
        info.default = right
        build()


@contextmanager
def code(file: str, old: str, new: str) -> Iterator[None]:
    """Another code of a function."""
    with pytest.MonkeyPatch.context() as patch:
        plant(patch, SourceFault("", "", file, old, new))
        yield


MODEL, MAPS, TEXTURE = "core/model.py", "core/transform.py", "textures/texture.py"
BALL = "shapes: [{type: sphere, center: [1, 2, 3]}]"
TURNED = "{scale: [1, 2, 3]}, {rotate: {axis: [1, 2, 2], degrees: 30}}, {translate: [1, 2, 3]}"
PLACED = f"shapes: [{{type: plane, transform: [{TURNED}]}}]"
ROWS = "[[1, 2, 0, 4], [0, 1, 3, 5], [0, 0, 1, 6]]"
METAL = "materials: {a: {type: rough_conductor, eta: [0.2, 0.9, 1.1], k: 3"

VALIDATORS: dict[str, tuple[str, str, Callable[[], Planted]]] = {
    "exponents lose their sign": (
        "lights: [{type: point, position: [1e-3, 0, 0], intensity: 2}]",
        "lights[0].position: the description says 0.001 0 0, the rendered scene has 1000 0 0",
        lambda: code(
            "util/yaml_text.py",
            'digits.replace(".", "", 1) if digits[-1] in "fF" else digits)',
            'digits.replace("e-", "e"))',
        ),
    ),
    "one factor of a scale leaves z": (
        "shapes: [{type: box, transform: [{translate: [0, 0, 1]}, {scale: 0.5}]}]",
        "shapes[0].transform[1].scale: the description says 0.5 0.5 0.5, the rendered scene has "
        "0.5 0.5 1",
        lambda: code(MAPS, "return (value,) * 3 if", "return (value, value, 1.0) if"),
    ),
    "y and z of vectors exchanged": (
        BALL,
        "shapes[0].center: the description says 1 2 3, the rendered scene has 1 3 2",
        lambda: code(
            MODEL, "tuple(float(x) for x in value)", "tuple(float(value[k]) for k in (0, 2, 1))"
        ),
    ),
    "green and blue of colours exchanged": (
        "lights: [{type: constant, radiance: [1, 0.8, 0.5]}]",
        "lights[0].radiance: the description says 1 0.8 0.5, the rendered scene has 1 0.5 0.8",
        lambda: code(
            MODEL, "    return rgb\n\n\ndef refl", "    return rgb[::2] + rgb[1:2]\n\n\ndef refl"
        ),
    ),
    "one number for a colour is red alone": (
        "lights: [{type: point, position: [0, 0, 0], intensity: 2}]",
        "lights[0].intensity: the description says 2 2 2, the rendered scene has 2 0 0",
        lambda: code(MODEL, "value = (value, value, value)", "value = (value, 0, 0)"),
    ),
    "reflectances decoded as sRGB": (
        "materials: {a: {type: diffuse, reflectance: [0.5, 0.25, 1]}}",
        "materials.a.reflectance: ",
        lambda: code(
            MODEL,
            'would create energy")\n    return rgb',
            'would create energy")\n    return tuple(x**2.2 for x in rgb)',
        ),
    ),
    "directions reversed": (
        "lights: [{type: directional, direction: [-1, -2, 0.5], irradiance: 1}]",
        "lights[0].direction: the description says -1 -2 0.5, the rendered scene has 1 2 -0.5",
        lambda: code(MODEL, "    return v\n", "    return tuple(-x for x in v)\n"),
    ),
    "steps of a transform in reverse": (
        PLACED,
        "shapes[0].transform[0]",
        lambda: code(
            MAPS,
            '({"matrix": value},)\n    return value',
            '({"matrix": value},)\n    return value[::-1]',
        ),
    ),
    "the last step of a transform lost": (
        PLACED,
        "shapes[0].transform: the description says 3 steps, the rendered scene has 2",
        lambda: code(
            MAPS,
            '({"matrix": value},)\n    return value',
            '({"matrix": value},)\n    return value[:-1]',
        ),
    ),
    "a matrix read by columns": (
        f"shapes: [{{type: plane, transform: {ROWS}}}]",
        "shapes[0].transform[0].matrix[0]: the description says 1 2 0 4, the rendered scene has "
        "1 0 0 4",
        lambda: code(
            MAPS,
            "return tuple(map(tuple, rows))",
            "return tuple((*(r[k] for r in rows), rows[k][3]) for k in range(3))",
        ),
    ),
    "a matrix without its offset": (
        f"shapes: [{{type: plane, transform: [{{matrix: {ROWS}}}]}}]",
        "shapes[0].transform[0].matrix[0]",
        lambda: code(
            MAPS, "return tuple(map(tuple, rows))", "return tuple((*r[:3], 0.0) for r in rows)"
        ),
    ),
    "one number for u and v is u's": (
        "textures: {a: {type: checker, uv: {scale: 4}}}",
        "textures.a.uv.scale: the description says 4 4, the rendered scene has 4 1",
        lambda: code(TEXTURE, "value = (value, value)", "value = (value, 1.0)"),
    ),
    "u and v of pairs exchanged": (
        "textures: {a: {type: checker, uv: {offset: [0.25, 0]}}}",
        "textures.a.uv.offset: the description says 0.25 0, the rendered scene has 0 0.25",
        lambda: code(TEXTURE, "value = tuple(value)", "value = tuple(value[::-1])"),
    ),
    "alpha squared": (
        f"{METAL}, alpha: 0.5}}}}",
        "materials.a.alpha: the description says 0.5 0.5, the rendered scene has 0.25 0.25",
        lambda: code(
            "materials/microfacet/ggx_and_smith.py", "else float(a) for", "else float(a) ** 2 for"
        ),
    ),
    "alpha along u for both": (
        f"{METAL}, alpha: [0.5, 0.1]}}}}",
        "materials.a.alpha: the description says 0.5 0.1, the rendered scene has 0.5 0.5",
        lambda: code(
            "materials/microfacet/ggx_and_smith.py",
            "float(a) for a in both)",
            "float(a) for a in both[:1] * 2)",
        ),
    ),
    "a matrix alone applied twice": (
        f"shapes: [{{type: plane, transform: {ROWS}}}]",
        "shapes[0].transform: the description says 1 steps, the rendered scene has 2",
        lambda: code(MAPS, 'return ({"matrix": value},)', 'return ({"matrix": value},) * 2'),
    ),
    "a view upside down": (
        "camera: {type: perspective, view: [-1, 1, -0.5, 1]}",
        "camera.view: the description says -1 1 -0.5 1, the rendered scene has -1 1 -1 0.5",
        lambda: code("cameras/view_rectangle.py", "return l, r, b, t", "return l, r, -t, -b"),
    ),
    "points of two numbers at z = 1": (
        "shapes: [{type: polygon, rings: [[[0, 0], [1, 0], [0, 1]]]}]",
        "shapes[0].rings",
        lambda: code("shapes/flat/polygon.py", "(*value, 0.0)", "(*value, 1.0)"),
    ),
}
"""Text, what the rung says of the place, and the fault."""

DEFAULTS: tuple[tuple[Any, str, Any, str], ...] = (
    (Perspective, "near", 0.5, "camera: {type: perspective}"),
    (Perspective, "up", (0.0, -1.0, 0.0), "camera: {type: perspective, fov: 30}"),
    (Perspective, "fov_axis", "y", "camera: {type: perspective, fov: 30}"),
    (Orthographic, "width", 1.0, "camera: {type: orthographic}"),
    (Pinhole, "film_distance", 2.0, "camera: {type: pinhole}"),
    (Pinhole, "hole_radius", 0.1, "camera: {type: pinhole}"),
    (ThinLens, "focus_distance", 1.0, "camera: {type: thin_lens, aperture_radius: 0.1}"),
    (GaussianFilter, "stddev", 0.6, "film: {filter: {type: gaussian}}"),
    (Sobol, "seed", 1, "sampler: {type: sobol}"),
    (PathTracing, "max_depth", 3, "integrator: {type: path}"),
    (Direct, "shadows", False, "integrator: {type: direct}"),
    (Torus, "minor_radius", 0.2525, "shapes: [{type: torus}]"),
    (Cone, "height", 2.0, "shapes: [{type: cone}]"),
    (Cylinder, "capped", False, "groups: {a: [{type: cylinder}]}"),
    (Sphere, "radius", 0.5, "shapes: [{type: union, of: [{type: sphere}]}]"),
    (Polygon, "fill", "nonzero", "shapes: [{type: polygon, rings: [[[0, 0], [1, 0], [0, 1]]]}]"),
    (Diffuse, "reflectance", (0.5, 0.5, 0.4), "materials: {a: {type: diffuse}}"),
    (RoughConductor, "alpha", (0.12, 0.12), f"{METAL}}}}}"),
    (Dielectric, "interior_ior", 1.45, "materials: {a: {type: dielectric}}"),
    (GltfPbr, "metallic", 0.0, "materials: {a: {type: gltf_pbr}}"),
    (GltfPbr, "ior", 1.45, "materials: {a: {type: gltf_pbr}}"),
    (Mask, "opacity", 1.0, "materials: {b: {type: mirror}, a: {type: mask, base: b}}"),
    (Checker, "second", (0.0, 0.0, 0.0), "textures: {a: {type: checker}}"),
    (VertexColours, "without", (1.0, 1.0, 1.0), "textures: {a: {type: vertex_colours}}"),
    (UvMap, "rotate", 90.0, "textures: {a: {type: checker, uv: {scale: 2}}}"),
    (
        Spot, "cutoff_angle", 21.0,
        "lights: [{type: spot, origin: [0, 0, 1], target: [0, 0, 0], intensity: 1}]",
    ),
    (
        Spot, "beam_width", 20.0,
        "lights: [{type: spot, origin: [0, 0, 1], target: [0, 0, 0], intensity: 1}]",
    ),
    (
        Projector, "fov", 90.0,
        "lights: [{type: projector, origin: [0, 0, 1], target: [0, 0, 0], irradiance: 1}]",
    ),
)  # fmt: skip
"""A field, another default, and a text that leaves it out."""


@pytest.mark.parametrize("name", VALIDATORS)
def test_faults_of_validators(name: str) -> None:
    text, place, planted = VALIDATORS[name]
    assert files(Scene.parse(text)).status == "agree"
    assert misread(Scene.parse(text)) is None
    with planted():
        found, in_gate = files(Scene.parse(text)), misread(Scene.parse(text))
    assert found.status == "differ"
    assert place in found.reason
    assert in_gate is not None
    assert (in_gate.status, in_gate.reason) == (found.status, found.reason)
    assert files(Scene.parse(text)).status == "agree"


def test_compare_says_it() -> None:
    """The case as a whole, which does not go on to pictures."""
    text, place, planted = VALIDATORS["one factor of a scale leaves z"]
    with planted():
        budget = Budget(pixels=20, light_pixels=16)
        subject = Subject(Scene.parse(text))
        case = compare_scene(subject, budget, lambda line: None, 1, ("files", "geometry"))
    assert case.verdict == "differ"
    assert case.reason.startswith(f"files: {place}")
    assert [rung.status for rung in case.rungs] == ["differ", "not-applicable"]


@pytest.mark.parametrize("fault", DEFAULTS, ids=lambda fault: f"{fault[0].__name__}.{fault[1]}")
def test_faults_of_defaults(fault: tuple[Any, str, Any, str]) -> None:
    cls, field, value, text = fault
    assert files(Scene.parse(text)).status == "agree"
    with default(cls, field, value):
        read = files(Scene.parse(text))
        kept = Scene.parse(text)
        python = files(Scene(**{name: getattr(kept, name) for name in kept.model_fields_set}))
        assert misread(kept) is not None
    for found in (read, python):
        assert found.status == "differ", found.reason
        assert re.search(rf"[.\]\w]\.{field}: the documented default is ", found.reason)
