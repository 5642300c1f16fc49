"""Renderers without shadows, without light that is scattered again, and without highlights are
recognised, and only those."""

import pytest
from gate_checks import BALL_ON_A_FLOOR

from comparisons.gate.pictures_in import Picture
from comparisons.gate.request import Request, gated
from comparisons.gate.terms import variants
from comparisons.results.case import Case, FloatArray
from reference_rt.integrators import Direct
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene

NOISY = (
    BALL_ON_A_FLOOR.replace("{type: grid, spp: 4}", "{type: sobol, spp: 256}")
    .replace("direct", "path, max_depth: 5")
    .replace("phong, diffuse: 0.1, specular: 0.3, exponent: 20", "rough_plastic, alpha: 0.3")
)


def pictures(scene: Scene) -> list[FloatArray]:
    """One without noise, else four replicates."""
    if scene.sampler is not None and scene.sampler.type == "grid":
        return [render(scene).colour]
    sampler = scene.resolved_sampler
    seeds = [sampler.model_copy(update={"seed": 50 + k}) for k in range(4)]
    return [render(scene.changed(sampler=one)).colour for one in seeds]


def judged(scene: Scene, found: list[FloatArray], rim: int = 0) -> Case:
    candidates = [Picture(picture) for picture in found]
    return gated(Request(scene=scene, limit=0.02, rim=rim), candidates)


def cause(case: Case) -> str:
    assert case.verdict == "differ"
    return "" if case.cause is None else case.cause.name


@pytest.mark.parametrize("text", [BALL_ON_A_FLOOR, pytest.param(NOISY, marks=pytest.mark.slow)])
def test_each_missing_term_is_named(text: str) -> None:
    scene = Scene.parse(text)
    wanted = [*variants(scene)]
    assert len(wanted) == (3 if text == BALL_ON_A_FLOOR else 5)
    for terms, other in wanted:
        case = judged(scene, pictures(other), rim=2)
        name = f"without {' and '.join(terms)}"
        # The diagnosis of path lengths has a name for this, too.
        also = "direct light alone" if name == "without multiple scattering" else name
        assert cause(case) in (name, also)


def test_a_part_of_a_term_is_not_named() -> None:
    """Half of each shadow, and no shadows at half the light."""
    scene = Scene.parse(BALL_ON_A_FLOOR)
    right, bright = (
        render(scene.changed(integrator=Direct(shadows=shadows))).colour
        for shadows in (True, False)
    )
    for wrong in (0.5 * (right + bright), 0.5 * bright):
        assert "without" not in cause(judged(scene, [wrong]))
    assert judged(scene, [right]).verdict in ("unchanged", "agree")


def test_a_small_shadow_is_no_bad_tile() -> None:
    """All of the difference is in one rectangle; of what explains it the simplest is named, though
    the scene has highlights where nothing shows them."""
    scene = Scene.parse(
        BALL_ON_A_FLOOR.replace("radius: 0.5, material: ball", "radius: 0.15, material: floor")
    )
    bright = render(scene.changed(integrator=Direct(shadows=False))).colour
    assert cause(judged(scene, [bright])) == "without shadows"
