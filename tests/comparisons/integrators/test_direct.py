"""Direct light that other renderers lack."""

from pathlib import Path

import pytest

import reference_rt as rt
from comparisons.cycles.translate import bounces_of
from comparisons.pbrt import write_pbrt
from comparisons.renderers import NoCounterpartError
from comparisons.translator import UntranslatableError, to_mitsuba
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Sphere
from reference_rt.util.errors import SceneError


@pytest.mark.parametrize("masked", [False, True])
def test_light_without_shadows_has_no_counterpart(masked: bool, tmp_path: Path) -> None:
    """Nor in the formats of other renderers; masks have an integrator of ours in Mitsuba."""
    scene = Scene(
        integrator=rt.Path(max_depth=2) if masked else rt.Direct(shadows=False),
        materials={"a": rt.Diffuse(), "m": rt.Mask(base="a")},
        shapes=(rt.Union(of=(Sphere(), Sphere()), material="m") if masked else Sphere(),),
    ).changed(integrator=rt.Direct(shadows=False))
    with pytest.raises(UntranslatableError, match="without shadows"):
        to_mitsuba(scene)
    with pytest.raises(SceneError) as caught:
        write_pbrt(scene, tmp_path / "s.pbrt")
    reasons = str(caught.value), *map(str, caught.value.others)
    assert sum("direct light without shadows" in reason for reason in reasons) == 1
    with pytest.raises(NoCounterpartError, match="without shadows"):
        bounces_of(scene.integrator)
