"""`explain --units`: its numbers are those of the gate's table, and the page has its rows."""

import math
from pathlib import Path

import pytest
from command_line import invoke

from comparisons.gate.conventions import RENDERERS
from reference_rt.cli.units import ROWS

SCENE = """
shapes: [{type: sphere, center: [0, 0, 0], radius: 1, material: lamp}]
materials: {lamp: {type: emissive, radiance: [1, 2, 3]}}
lights:
  - {type: point, position: [0, 3, 0], intensity: [1, 2, 4]}
  - {type: directional, direction: [0, -1, 0], irradiance: [3, 3, 3]}
  - {type: ambient, radiance: [1, 1, 1]}
"""

PAGE = Path(__file__).parents[3] / "docs" / "conventions.md"


def test_the_numbers_of_each_lamp(tmp_path: Path) -> None:
    path = tmp_path / "lamps.yaml"
    path.write_text(SCENE, encoding="utf-8")
    lines = invoke("explain", "--units", path).stdout.splitlines()
    assert "lights[0]: point, intensity I = 1 2 4 W/sr" in lines
    assert "  LuxCore (2.11.2): point: gain 4π I = 12.5664 25.1327 50.2655" in lines
    assert "  POV-Ray (3.7.0.10): parallel: rgb E / π = 0.95493 0.95493 0.95493" in lines
    assert "lights[2]: ambient: no row" in lines
    assert "materials.lamp: area, radiance L = 1 2 3 W/sr/m²" in lines


def test_the_two_tables_agree() -> None:
    """A number that makes our light is the inverse of the light that our number makes."""
    found = 0
    for known in RENDERERS.values():
        for kind, rows in ROWS.items():
            row = next((r for r in rows if r.renderer == known.title), None)
            if row is None or row.factor is None or kind == "area":
                continue
            factor = known.changes.lights.get(kind, 1.0)
            if (known.title, kind) == ("tachyon", "point"):
                factor = math.pi  # with attenuation, which no number makes
            assert row.factor * factor == pytest.approx(1.0)
            assert row.measured == known.version
            found += 1
    assert found >= 12


@pytest.mark.parametrize("name", RENDERERS)
def test_the_page_has_each_renderer(name: str) -> None:
    known = RENDERERS[name]
    row = next(line for line in PAGE.read_text().splitlines() if line.startswith(f"| `{name}` "))
    assert known.version in row
    for words in known.picture.words():
        assert words in row
