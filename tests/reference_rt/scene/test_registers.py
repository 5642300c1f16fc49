"""The registers of types, and the examples that stand in each type's file."""

import typing

import numpy as np
import pytest

import reference_rt as rt
from reference_rt.cameras import AnyCamera
from reference_rt.cameras.film import AnyFilter
from reference_rt.core.model import name_of, types_of
from reference_rt.integrators import AnyIntegrator
from reference_rt.jit.by_code import Table, described_in, tables_of
from reference_rt.lights import AnyLight
from reference_rt.lights import tables as lights
from reference_rt.materials import AnyMaterial
from reference_rt.materials.bsdfs import tables as bsdfs
from reference_rt.media import AnyMedium, AnyPhase
from reference_rt.sampling import AnySampler
from reference_rt.scene.examples import NAMED, examples, write_files
from reference_rt.shapes import TABLES, Primitive
from reference_rt.shapes.csg import AnyShape
from reference_rt.shapes.shape import Shape, TabulationContext
from reference_rt.textures import AnyTexture
from reference_rt.textures import tables as textures

KINDS = {
    "shapes": AnyShape,
    "materials": AnyMaterial,
    "media": AnyMedium,
    "phases": AnyPhase,
    "textures": AnyTexture,
    "lights": AnyLight,
    "cameras": AnyCamera,
    "filters": AnyFilter,
    "samplers": AnySampler,
    "integrators": AnyIntegrator,
}
TYPES = [of for kind in KINDS.values() for of in types_of(kind)]

COMMON = {
    *("type", "material", "transform", "interior", "exterior", "uv", "uv_set"),
    *("eye", "target", "up", "near", "far", "medium"),
}
"""Fields that types share, some of which only some need examples of."""

IN_FILES = {("mesh", "file"), ("bitmap", "layer"), ("environment_map", "layer")}
FORMATS = {("environment_map", "encoding"), ("environment_map", "transform")}
"""What only files of certain formats have."""


@pytest.mark.parametrize("of", TYPES, ids=name_of)
def test_examples_cover_the_options(of):
    """Each field is somewhere not its default."""
    found = examples(of)
    for field, info in of.__pydantic_fields__.items():
        if field in COMMON or {(name_of(of), field)} & (IN_FILES | FORMATS):
            continue
        default = info.get_default(call_default_factory=True)
        values = [getattr(example, field) for example in found]
        assert any(np.any(value != default) for value in values if value is not None), field


@pytest.mark.parametrize("of", TYPES, ids=name_of)
def test_every_type_is_a_public_name(of):
    assert getattr(rt, of.__name__) is of


def test_a_scene_of_all_examples(tmp_path):
    """Is valid, says itself in YAML and JSON, and has tables."""
    write_files(tmp_path)
    named = dict(NAMED)
    for kind in ("textures", "materials", "media"):
        more = {f"{of.type} {k}": of for k, of in enumerate(examples(KINDS[kind]))}
        named[kind] = NAMED[kind] | more
    sky = [light for light in examples(AnyLight) if light.type != "environment_map"]
    scene = rt.Scene(
        **named,
        shapes=tuple(examples(AnyShape)),
        lights=tuple(sky),
        integrator=rt.RayCast(),  # which takes any Phong material, and media
        sampler=rt.Independent(),
    )
    file = tmp_path / "scene.json"
    file.write_text(scene.to_json())
    again = rt.Scene.load(file)
    assert again.to_json() == scene.to_json()
    tables = again.tables
    assert all(table is not None for table in tables.geometry.shapes)
    assert all(table is not None for table in tables.materials.leaves)
    assert all(getattr(tables.textures, row[1]) is not None for row in textures.TABLES)
    assert all(getattr(tables.lights, field) is not None for _, field, _, _ in lights.TABLES)


@pytest.mark.parametrize("of", types_of(Primitive), ids=name_of)
def test_a_shape_is_rows_of_a_table_of_the_register(of):
    assert issubclass(of, Shape)
    for example in examples(of):
        assert type(example.tabulate(TabulationContext())) in {row.table for row in TABLES}


@pytest.mark.parametrize("tables", [bsdfs.Leaves, lights.Lights, textures.Textures])
def test_codes_are_the_order_of_the_tables(tables):
    rows = tables_of(tables)
    assert [row.code for row in rows] == list(range(len(rows)))
    fields = [field for field in tables._fields if field in {row.field for row in rows}]
    assert [row.field for row in rows] == fields
    assert len({id(row.module) for row in rows}) == len(rows)


def test_what_is_no_table_has_no_code():
    class Tables(typing.NamedTuple):
        first: typing.Annotated[Table | None, bsdfs]
        kind: int
        second: typing.Annotated[int | str | None, lights]

    assert tables_of(Tables) == (Table(0, "first", Table, bsdfs), Table(1, "second", int, lights))


def test_a_description_that_is_not_in_the_union():
    with pytest.raises(ValueError, match="not enough values"):
        described_in(bsdfs, AnyLight)
