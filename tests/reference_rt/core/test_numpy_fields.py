"""NumPy in descriptions: every field takes arrays and NumPy scalars for lists and numbers, and
refuses what is neither; whatever is wrong with a description is a SceneError with its keys."""

from pathlib import Path

import numpy as np
import pytest
from builders import import_everything

import reference_rt as rt
from reference_rt.core import transform
from reference_rt.core.model import Description
from reference_rt.shapes.csg import Solid
from reference_rt.textures.texture import UvMap

import_everything()

BASES = {
    *("Camera", "CentralCamera", "Filter", "Shape", "Solid", "Texture"),
    *("Material", "Coated", "Metal", "Transparent", "Wrapper"),
}
BALLS = [{"type": "sphere"}, {"type": "box", "transform": [{"scale": 0.5}]}]
REQUIRED = {
    "ThinLens": {"aperture_radius": 0.25},
    "Intersection": {"of": BALLS},
    "Difference": {"of": BALLS},
    "Union": {"of": BALLS},
    "Instance": {"group": "g", "transform": [{"translate": [1.0, 2.0, 3.0]}]},
    "Ambient": {"radiance": [0.5, 0.25, 1.0]},
    "Constant": {"radiance": [0.5, 0.25, 1.0]},
    "Directional": {"direction": [0.0, 3.0, 4.0], "irradiance": [0.5, 0.25, 1.0]},
    "EnvironmentMap": {
        "file": "sky.exr",
        "transform": [{"rotate": {"axis": [0.0, 1.0, 0.0], "degrees": 30.0}}],
    },
    "Point": {"position": [1.0, 2.0, 3.0], "intensity": [0.5, 0.25, 1.0]},
    "Projector": {
        "origin": [1.0, 2.0, 3.0],
        "target": [0.0, 0.0, 1.0],
        "irradiance": [0.5, 0.25, 1.0],
    },
    "Goniometric": {
        "origin": [1.0, 2.0, 3.0],
        "target": [0.0, 0.0, 1.0],
        "vertical_angles": [0.0, 45.0, 90.0],
        "horizontal_angles": [0.0, 90.0],
        "values": [[0.5, 0.25, 1.0], [0.5, 0.75, 2.0]],
    },
    "Spot": {"origin": [1.0, 2.0, 3.0], "target": [0.0, 0.0, 1.0], "intensity": [0.5, 0.25, 1.0]},
    "BlendPhase": {"first": {"type": "isotropic"}, "second": {"type": "hg", "g": 0.5}},
    "Homogeneous": {"sigma_t": [0.5, 0.25, 1.0], "albedo": [0.5, 0.25, 1.0]},
    "Bump": {"base": "m", "height": "t"},
    "Conductor": {"eta": [0.25, 0.5, 1.5], "k": [4.0, 2.0, 1.5]},
    "RoughConductor": {"eta": [0.25, 0.5, 1.5], "k": [4.0, 2.0, 1.5], "alpha": [0.25, 0.5]},
    "Emissive": {"radiance": [0.5, 0.25, 1.0]},
    "NormalMap": {"base": "m", "normals": "t"},
    "Phong": {"diffuse": [0.5, 0.25, 0.0]},
    "Blend": {"first": "m", "second": "n"},
    "Mask": {"base": "m"},
    "TwoSided": {"base": "m"},
    "Mesh": {
        "vertices": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        "faces": [[0, 1, 2]],
        "normals": [[0.0, 0.0, 2.0]] * 3,
        "uv": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        "colours": [[0.5, 0.25, 1.0]] * 3,
    },
    "Polygon": {"rings": [[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]]},
    "Quadric": {
        "coefficients": [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0],
        "lower": [-1.0, -1.0, -1.0],
        "upper": [1.0, 1.0, 1.0],
    },
    "Triangle": {"v0": [0.0, 0.0, 0.0], "v1": [1.0, 0.0, 0.0], "v2": [0.0, 1.0, 0.0]},
    "Bitmap": {"file": "a.png"},
    "Product": {"of": ["t", "u"]},
    "Matrix": {"matrix": np.eye(3, 4).tolist()},
    "Rotate": {"rotate": {"axis": [0.0, 1.0, 0.0], "degrees": 30.0}},
    "Translate": {"translate": [1.0, 2.0, 3.0]},
    "Scale": {"scale": [1.0, 2.0, 3.0]},
    "Turn": {"axis": [0.0, 1.0, 0.0], "degrees": 30.0},
    "Scene": {
        "shapes": [{"type": "sphere", "center": [1.0, 2.0, 3.0], "material": "m"}],
        "materials": {"m": {"type": "diffuse", "reflectance": [0.5, 0.25, 1.0]}},
        "groups": {"g": [{"type": "torus", "minor_radius": 0.125}]},
        "lights": [{"type": "point", "position": [1.0, 2.0, 3.0], "intensity": 2.0}],
    },
}


def _below(base):
    for cls in base.__subclasses__():
        yield from _below(cls)
        if cls.__module__.startswith("reference_rt.") and cls.__name__ not in BASES:
            yield cls


CLASSES = sorted(set(_below(Description)), key=lambda cls: cls.__name__)
NAMES = [cls.__name__ for cls in CLASSES]


def example(cls):
    return cls(**REQUIRED.get(cls.__name__, {}))


def is_number(value):
    return isinstance(value, int | float) and not isinstance(value, bool)


def has_numbers(value):
    """A number, or rows of them."""
    rows = isinstance(value, list | tuple) and len(value) > 0
    return is_number(value) or (rows and all(map(has_numbers, value)))


def test_all_descriptions_are_tested():
    assert len(CLASSES) > 50
    assert {rt.Sphere, rt.Scene, rt.Film, rt.Sobol, UvMap, transform.Matrix} <= set(CLASSES)
    assert not any(issubclass(cls, Solid) and cls is Solid for cls in CLASSES)
    for cls in CLASSES:
        required = {n for n, field in cls.model_fields.items() if field.is_required()}
        assert required <= set(REQUIRED.get(cls.__name__, {}))


class Foreign:
    """An array of another library."""

    def __init__(self, array):
        self.array = array

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self.array, dtype)


def read_only(array):
    array.flags.writeable = False
    return array


def strided(array):
    wide = np.full((*array.shape, 2), np.nan if array.dtype.kind == "f" else 99, array.dtype)
    wide[..., 0] = array
    return wide[..., 0]


def of_type(array, floats, integers):
    array = np.asarray(array)
    return array.astype(floats if array.dtype.kind == "f" else integers)


FORMS = {
    "float64": np.asarray,
    "read-only": lambda a: read_only(np.array(a)),
    "strided": lambda a: strided(np.array(a)),
    "fortran": lambda a: np.array(a, order="F"),
    "longdouble": lambda a: of_type(a, np.longdouble, "i2"),
    "list of rows": lambda a: list(np.asarray(a)) if np.ndim(a) else np.asarray(a)[()],
    "foreign": lambda a: Foreign(np.asarray(a)),
    "float32": lambda a: of_type(a, np.float32, "u4"),
}


def made(value, form):
    """Plain data with NumPy's objects for all that has numbers."""
    if isinstance(value, dict):
        return {key: made(item, form) for key, item in value.items()}
    if isinstance(value, bool):
        return np.bool_(value)
    if is_number(value):
        return form(value)
    if isinstance(value, list | tuple) and value:
        try:
            if np.asarray(value).dtype.kind in "if":
                return form(value)
        except ValueError:  # rows of different lengths
            pass
        return [made(item, form) for item in value]
    return Path(value) if isinstance(value, str) and "." in value else value


def as_float32(value):
    if isinstance(value, dict):
        return {key: as_float32(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [as_float32(item) for item in value]
    return float(np.float32(value)) if isinstance(value, float) else value


@pytest.mark.parametrize("form", FORMS)
def test_every_field_takes_arrays(form):
    for cls in CLASSES:
        data = example(cls).model_dump()
        if form == "float32":
            data = as_float32(data)
        found, expected = cls(**made(data, FORMS[form])), cls(**data)
        assert found == expected, cls
        assert hash(found) == hash(expected) or cls is rt.Scene, cls
        # Python's own numbers all the way down: their text is the same.
        assert repr(found) == repr(expected), cls
        assert cls.model_validate(made(data, FORMS[form])) == expected, cls
        assert cls.model_validate_json(expected.model_dump_json()) == expected, cls


BAD = {
    "nan": lambda a: np.full(np.shape(a), np.nan),
    "inf": lambda a: np.full(np.shape(a), np.inf),
    "complex": lambda a: np.asarray(a, complex),
    "object": lambda a: np.full(np.shape(a), None),
    "bool": lambda a: np.full(np.shape(a), True),
    "string": lambda a: np.full((*np.shape(a), 1), "a"),
    "shape": lambda a: np.ones((5, 6, 7)),
    "empty": lambda a: np.ones((0,)),
    "date": lambda a: np.full(np.shape(a), np.datetime64("2020")),
}


@pytest.mark.parametrize("bad", BAD)
def test_every_field_refuses_what_is_no_number(bad):
    for cls in CLASSES:
        data = example(cls).model_dump()
        for name, value in data.items():
            if not has_numbers(value):
                continue
            with pytest.raises(rt.SceneError, match="expected") as caught:
                cls(**(data | {name: BAD[bad](value)}))
            assert caught.value.path[0] == name, (cls, caught.value)


@pytest.mark.parametrize("cls", CLASSES, ids=NAMES)
def test_every_error_is_a_scene_error(cls):
    data = example(cls).model_dump()
    for name in data:
        with pytest.raises(rt.SceneError, match="expected") as caught:
            cls(**(data | {name: object()}))
        assert caught.value.path[0] == name
        with pytest.raises(rt.SceneError, match="frozen") as caught:
            setattr(example(cls), name, data[name])
        assert caught.value.path == (name,)
        with pytest.raises(rt.SceneError, match="frozen"):
            delattr(example(cls), name)
    with pytest.raises(rt.SceneError, match="unknown key; expected one of") as caught:
        cls(**data, nonsense=1)
    assert caught.value.path == ("nonsense",)
    for name, field in cls.model_fields.items():
        if field.is_required():
            with pytest.raises(rt.SceneError, match="missing; expected") as caught:
                cls(**{key: value for key, value in data.items() if key != name})
            assert caught.value.path == (name,)
    for wrong in (5, [1], None):
        with pytest.raises(rt.SceneError, match="expected"):
            cls.model_validate(wrong)
    with pytest.raises(rt.SceneError, match="malformed JSON"):
        cls.model_validate_json("{")


def test_keys_lead_through_what_is_nested():
    """From the description that is made, as from a scene file."""
    for shapes in ([{"type": "sphere"}, {"type": "sphere", "center": np.full(3, np.nan)}],):
        for form in (list, tuple):
            with pytest.raises(rt.SceneError) as caught:
                rt.Scene(shapes=form(shapes))
            assert caught.value.path == ("shapes", 1, "center", 0)
    with pytest.raises(rt.SceneError, match=r"^of\[1\]\.transform\[0\].scale: "):
        rt.Union(of=[rt.Sphere(), {"type": "box", "transform": [{"scale": np.array("a")}]}])
    nested = []
    nested.append(nested)
    with pytest.raises(rt.SceneError, match="nested too deeply; expected fewer levels"):
        rt.Sphere(center=nested)


MATRIX = np.array([[0.0, -2, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])


@pytest.mark.parametrize("rows", [3, 4])
@pytest.mark.parametrize("form", [np.asarray, np.ndarray.tolist, lambda m: tuple(map(tuple, m))])
def test_matrices(rows, form):
    """Of three rows and of four, alone and among steps, as arrays, lists and tuples."""
    m = form(MATRIX[:rows])
    expected = transform.Matrix(matrix=MATRIX[:3].tolist())
    assert transform.Matrix(matrix=m) == expected
    assert np.array_equal(expected.matrix_of(), MATRIX[:3])
    assert rt.Sphere(transform=m) == rt.Sphere(transform=(expected,))
    assert rt.EnvironmentMap(file="a.exr", transform=m).transform == (expected,)
    steps = [{"matrix": m}, transform.Scale(scale=np.float64(2))]
    assert rt.Sphere(transform=steps).transform == (expected, transform.Scale(scale=2.0))


def test_matrices_that_are_not_affine():
    projective = MATRIX.copy()
    projective[3] = [0, 0, 0.5, 1]
    for m in (projective, projective.T):
        with pytest.raises(rt.SceneError, match=r"last row is \[0, 0, 0, 1\]") as caught:
            transform.Matrix(matrix=m)
        assert caught.value.path == ("matrix",)
        with pytest.raises(rt.SceneError, match=r"last row is \[0, 0, 0, 1\]"):
            rt.Sphere(transform=m)
    for m in (np.eye(3), np.ones((2, 4)), np.ones((5, 4)), np.ones((4, 3))):
        with pytest.raises(rt.SceneError, match="expected"):
            transform.Matrix(matrix=m)
        with pytest.raises(rt.SceneError, match="expected"):
            rt.Sphere(transform=m)


def test_files_are_read_without_looking_for_arrays(monkeypatch):
    """Scene files hold plain data: for large ones the search would take time."""
    calls = []
    monkeypatch.setattr("reference_rt.core.model.plain", calls.append)
    scene = rt.Scene.parse("shapes: [{type: sphere, center: [1, 2, 3], transform: [{scale: 2}]}]")
    assert scene.shapes[0].center == (1.0, 2.0, 3.0)
    assert not calls
