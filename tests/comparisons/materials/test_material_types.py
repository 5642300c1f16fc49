"""Laws of all types of materials: each is known once, Mitsuba's defaults are Mitsuba's, and what is
written to its scene files is read again."""

import warnings
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from comparisons.materials import MATERIALS, READERS, MaterialType
from comparisons.materials.both_sides import both_sides, directions
from comparisons.mitsuba.backend import mitsuba, scalar
from comparisons.mitsuba.context import TranslationContext
from comparisons.mitsuba.plugin_table import PluginTable, Row
from comparisons.translator.writing import write_xml
from reference_rt.core.model import types_of
from reference_rt.materials import (
    AnyMaterial,
    Emissive,
    Material,
    NormalMap,
    Principled,
    RoughConductor,
    RoughDielectric,
)
from reference_rt.rendering.scene import Scene
from reference_rt.scene.examples import NAMED, examples, write_files
from reference_rt.shapes import Sphere
from reference_rt.textures import Bitmap, texture_names
from reference_rt.util.errors import SceneError


def test_each_type_is_known_once():
    assert {one.description for one in MATERIALS} == set(types_of(AnyMaterial))
    plugins = [plugin for one in MATERIALS for plugin in one.from_mitsuba]
    assert len(plugins) == len(READERS)


# ---- defaults ------------------------------------------------------------------------------------

DIFFUSE = {"type": "diffuse"}
NEEDED: dict[str, dict[str, Any]] = {
    "mask": {"base": DIFFUSE},
    "blendbsdf": {"first": DIFFUSE, "second": DIFFUSE, "weight": 0.25},
    "bumpmap": {"base": DIFFUSE, "height": {"type": "checkerboard"}},
    "normalmap": {"base": DIFFUSE, "normalmap": {"type": "checkerboard"}},
}
"""What a plugin does not load without."""

OURS = ("textbook_phong", "gltf_pbr")
"""Our plugins, whose parameters are all given."""

UNTOLD = {
    (plugin, flag)
    for plugin in ("bumpmap", "normalmap")
    for flag in ("flip_invalid_normals", "use_shadowing_function")
}
"""Parameters that Mitsuba's objects do not tell: the light of `BSDFS` in tests/helpers does."""

ROWS = [
    pytest.param(one.table, row, id=f"{one.table.plugin}-{row.name}")
    for one in MATERIALS
    if one.table is not None and one.table.plugin not in OURS
    for row in one.table.rows
    if row.default is not None
]


@cache
def told(plugin: str, **values: Any) -> tuple[dict[str, str], str]:
    """What Mitsuba's object says of itself: its parameters by name, and its description."""
    mi = mitsuba()
    bsdf = mi.load_dict({"type": plugin, **NEEDED.get(plugin, {}), **values})
    parameters = mi.traverse(bsdf)
    return {name: repr(parameters[name]) for name in parameters.keys()}, str(bsdf)  # noqa: SIM118


def another(value: Any) -> Any:
    if isinstance(value, bool):
        return not value
    if isinstance(value, str):
        return "ggx" if value == "beckmann" else "diamond"
    return 0.5 * value + 0.1


@pytest.mark.parametrize(("table", "row"), ROWS)
def test_defaults_are_mitsubas(table: PluginTable, row: Row) -> None:
    mitsuba()
    with scalar():
        without, default, other = (
            told(table.plugin, **given)
            for given in ({}, {row.name: row.default}, {row.name: another(row.default)})
        )
    if (table.plugin, row.name) in UNTOLD:
        assert without == default == other
    elif row.default == 1.0 and row.name not in str(without):
        # A factor that is not given is none.
        name = f"{row.name}.value"
        assert default[0] == without[0] | {name: "1.0"}
        assert name in other[0]
    else:
        assert without == default
        assert without != other


# ---- files ---------------------------------------------------------------------------------------


def whole(scene: Scene, name: str | None) -> Any:
    """A material with those that it is made of, and with its textures."""
    if name is None:
        return None
    material = scene.materials[name]
    fields = {field: looked_up(scene, value) for field, value in material.model_dump().items()}
    for base in (*getattr(material, "bases", ()), *(("base",) * isinstance(material, Emissive))):
        fields[base] = whole(scene, getattr(material, base))
    if isinstance(material, Principled) and material.eta is None is material.specular:
        fields["specular"] = 0.5  # the default, which files say
    if isinstance(material, RoughConductor | RoughDielectric) and isinstance(material.alpha, str):
        fields["alpha"] = (fields["alpha"],) * 2  # files say both
    return fields


def looked_up(scene: Scene, value: Any) -> Any:
    """A field's value, for a texture's name its map and its texels in float32."""
    if isinstance(value, tuple):
        return tuple(looked_up(scene, one) for one in value)
    if not isinstance(value, str) or value not in scene.textures:
        return value
    texture = scene.textures[value]
    fields = texture.model_dump(exclude={"file", "encoding", "scale", "channel"})
    if isinstance(texture, Bitmap):
        fields["texels"] = texture.read(scene.folder).linear.astype(np.float32).tolist()
    return fields


@pytest.mark.parametrize("material", examples(AnyMaterial), ids=lambda m: m.type)
def test_what_is_written_is_read_again(material: Material, tmp_path: Path) -> None:
    write_files(tmp_path)
    scene = Scene(
        textures=NAMED["textures"],
        materials={**NAMED["materials"], "it": material},
        shapes=(Sphere(material="it"),),
    )
    scene._folder = tmp_path
    if isinstance(material, NormalMap) and (material.scale, material.follow_v) != (1.0, False):
        with pytest.raises(SceneError, match="NormalMap with 'scale' or 'follow_v'"):
            write_xml(scene, tmp_path / "out.xml")
        return
    write_xml(scene, tmp_path / "out.xml")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read = Scene.load(tmp_path / "out.xml")
    (shape,) = read.shapes
    assert whole(read, shape.material) == whole(scene, "it")


# ---- parameters that are not read ----------------------------------------------------------------

IGNORED = [
    pytest.param(one, name, id=f"{one.table.plugin}-{name}")
    for one in MATERIALS
    if one.table is not None
    for name in one.table.ignored
]


@pytest.mark.parametrize(("one", "name"), IGNORED)
def test_what_is_not_read_changes_no_value(one: MaterialType, name: str) -> None:
    """Of Mitsuba's own plugin, by all examples of our type."""
    assert one.table is not None
    wo, wi = directions(20, seed=3, both=True)
    values = (False, True) if name == "sample_visible" else (0.25, 4.0)
    for material in examples(one.description):
        if not texture_names(material):
            plugin = one.table.write(material, TranslationContext({}, {}, Path()))
            a, b = (both_sides(material, wo, wi, {**plugin, name: x})[1] for x in values)
            assert a.any()
            np.testing.assert_array_equal(a, b)
