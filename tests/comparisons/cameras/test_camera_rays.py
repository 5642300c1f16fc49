"""Every camera makes the same rays in both kinds of Mitsuba's variants, and in scene files."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.backend import variant as in_variant
from comparisons.rungs import geometry
from comparisons.rungs.rays.camera import camera_rays, compare_camera
from comparisons.translator import load, to_mitsuba
from comparisons.translator.writing import write_xml
from reference_rt.cameras import AnyCamera, Orthographic, Perspective, Pinhole, ThinLens
from reference_rt.cameras.film import Film
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables
from reference_rt.shapes import Sphere

TILTED = {"eye": (3.0, 2.0, -5.0), "target": (0.3, 0.2, 0.1), "up": (0.1, 1.0, 0.2)}

AXES = ("x", "y", "diagonal", "smaller", "larger")

WIDE, TALL = (36, 24), (16, 40)

OFF_AXIS = (-0.15, 0.75, -0.5, 0.1)
"""3 to 2: of a picture that is WIDE the pixels are square."""

CASES: tuple[tuple[AnyCamera, tuple[int, int]], ...] = (
    *((Perspective(**TILTED, fov=70.0, fov_axis=axis), WIDE) for axis in AXES),
    *((Perspective(**TILTED, fov=70.0, fov_axis=axis), TALL) for axis in AXES),
    (
        Perspective(eye=(0.0, 0.0, 0.0), target=(0.0, -1.0, 0.0), up=(1.0, 0.0, 0.0), fov=150.0),
        TALL,
    ),
    (Perspective(eye=(-40.0, 3.0, 9.0), fov=0.5), WIDE),
    (Perspective(**TILTED, view=OFF_AXIS), WIDE),
    (Perspective(**TILTED, view=OFF_AXIS, distance=0.2), WIDE),
    (Perspective(**TILTED, view=(-2.0, 3.0, 4.0, 16.5), distance=3.0), TALL),
    (Perspective(**TILTED, view=(5.0, 5.3, -0.1, 0.1)), WIDE),  # 79 degrees off the axis
    (Orthographic(**TILTED, width=7.0), WIDE),
    (Orthographic(**TILTED, view=OFF_AXIS), WIDE),
    (Orthographic(**TILTED, view=OFF_AXIS), TALL),  # oblong pixels
    (Orthographic(eye=(0.0, 9.0, 0.0), up=(0.0, 0.0, -1.0), view=(0.0, 1e-2, -50.0, 3.0)), WIDE),
    (Pinhole(**TILTED), WIDE),
    (Pinhole(**TILTED, film_width=0.3, film_distance=2.0), TALL),
    (Pinhole(**TILTED, hole_radius=0.1), WIDE),
    (Pinhole(**TILTED, film_width=0.3, film_distance=0.2, hole_radius=0.5, exposure=2.0), TALL),
    (Pinhole(**TILTED, film_width=8.0, film_distance=4.0, hole_radius=1e-4), WIDE),
    *((ThinLens(**TILTED, fov=50.0, fov_axis=a, aperture_radius=0.2), WIDE) for a in AXES),
    (ThinLens(**TILTED, view=(-0.6, 0.6, -0.4, 0.4), aperture_radius=0.01), WIDE),
    (ThinLens(**TILTED, fov=90.0, aperture_radius=3.0, focus_distance=0.4), TALL),
    # What Mitsuba's own cameras cannot have: oblong pixels, a lens off the axis of the view.
    (Perspective(**TILTED, view=OFF_AXIS), TALL),
    (Perspective(**TILTED, view=(-0.6, 0.6, -0.4, 0.40001)), WIDE),
    (ThinLens(**TILTED, view=(-1.0, 1.0, -1.0, 1.0), aperture_radius=1.0), WIDE),
    (ThinLens(**TILTED, view=OFF_AXIS, aperture_radius=1.0), WIDE),
    (ThinLens(**TILTED, view=OFF_AXIS, aperture_radius=0.1, focus_distance=7.0), TALL),
    (ThinLens(**TILTED, fov=90.0, aperture_radius=1e-3, focus_distance=400.0), TALL),
)


@pytest.fixture(params=["fastest", "scalar_rgb"], scope="module")  # to switch is slow
def variant(request: pytest.FixtureRequest) -> Iterator[str]:
    mi = mitsuba()
    with in_variant(mi.variant() if request.param == "fastest" else request.param):
        yield mi.variant()


def seen_by(camera: AnyCamera, size: tuple[int, int] = WIDE) -> Scene:
    return Scene(camera=camera, film=Film(width=size[0], height=size[1]), shapes=(Sphere(),))


@pytest.mark.parametrize("planes", [{}, {"near": 0.3, "far": 9.0}], ids=["", "clipped"])
@pytest.mark.parametrize(("camera", "size"), CASES)
def test_cameras_send_the_same_rays(
    variant: str, camera: AnyCamera, size: tuple[int, int], planes: dict[str, float]
) -> None:
    scene = seen_by(camera.model_copy(update=planes), size)
    found = compare_camera(scene, load(scene), 48)
    assert found.problem == ""
    # Measured over random cameras in both variants: 0.35.
    assert found.numbers["max_camera_direction_error_over_bound"] <= 0.7


@pytest.mark.parametrize(("camera", "size"), CASES)
def test_cameras_in_files_send_the_same_rays(
    camera: AnyCamera, size: tuple[int, int], tmp_path: Path
) -> None:
    scene = seen_by(camera.model_copy(update={"near": 0.3, "far": 9.0}), size)
    write_xml(scene, tmp_path / "scene.xml")
    again = Scene.load(tmp_path / "scene.xml")
    assert (again.camera.near, again.camera.far) == (0.3, 9.0)
    exposures = {getattr(one.camera, "exposure", None) for one in (scene, again)}
    assert len(exposures) == 1
    x, y = (np.linspace(0.01, 0.99, 7) * length for length in size)
    for ours, theirs in zip(
        *(camera_rays(one, x, y, (0.8, 0.3)) for one in (scene, again)), strict=True
    ):
        np.testing.assert_allclose(theirs, ours, rtol=0.0, atol=1e-12 * np.abs(ours).max())


PLAIN = Perspective(**TILTED, fov=70.0)
FRONTAL = Perspective(**TILTED, view=OFF_AXIS)
LENS = ThinLens(**TILTED, fov=50.0, aperture_radius=0.2, focus_distance=4.0)
BOX = Pinhole(**TILTED)
HOLE = Pinhole(**TILTED, hole_radius=0.2)


@pytest.mark.parametrize(
    ("camera", "other"),
    [
        (PLAIN, PLAIN.model_copy(update={"fov": 70.01})),
        (PLAIN, PLAIN.model_copy(update={"fov_axis": "y"})),
        (PLAIN, PLAIN.model_copy(update={"up": (0.1001, 1.0, 0.2)})),
        (PLAIN, PLAIN.model_copy(update={"eye": (3.0, 2.0, -5.0001)})),
        (FRONTAL, Perspective(**TILTED, view=(-0.75, 0.15, -0.5, 0.1))),
        (FRONTAL, Perspective(**TILTED, view=(-0.15, 0.75, -0.1, 0.5))),
        (FRONTAL, Perspective(**TILTED, view=(-0.1499, 0.7501, -0.5, 0.1))),
        (FRONTAL, Perspective(**TILTED, view=OFF_AXIS, distance=1.0001)),
        (Orthographic(**TILTED), Orthographic(**TILTED, view=(-1.0, 1.0001, -0.6667, 0.6667))),
        (Orthographic(**TILTED, view=OFF_AXIS), Orthographic(**TILTED, view=(-0.15, 0.75, 0, 0.6))),
        (BOX, Perspective(**TILTED, view=(-0.5, 0.5, -1 / 3, 1 / 3))),
        (BOX, Pinhole(**TILTED, film_distance=1.0001)),
        (HOLE, BOX),
        (HOLE, HOLE.model_copy(update={"hole_radius": 0.2001})),
        (HOLE, HOLE.model_copy(update={"film_width": 2.001, "film_distance": 2.001})),
        (HOLE, ThinLens(**TILTED, view=(-0.5, 0.5, -1 / 3, 1 / 3), aperture_radius=0.2)),
        (LENS, Perspective(**TILTED, fov=50.0)),
        (LENS, LENS.model_copy(update={"aperture_radius": 0.2001})),
        (LENS, LENS.model_copy(update={"focus_distance": 4.001})),
        (LENS, LENS.model_copy(update={"fov": 50.01})),
    ],
)
def test_another_camera_is_distinguished(camera: AnyCamera, other: AnyCamera) -> None:
    scene = seen_by(camera)
    problem = compare_camera(scene, load(seen_by(other)), 200).problem
    assert problem.startswith("the camera: ")
    assert "Mitsuba's from" in problem


@pytest.mark.parametrize("plane", ["near", "far"])
@pytest.mark.parametrize("camera", [PLAIN, FRONTAL, BOX, LENS, Orthographic(**TILTED)])
def test_other_clipping_planes_are_distinguished(camera: AnyCamera, plane: str) -> None:
    ours = camera.model_copy(update={"near": 0.3, "far": 9.0})
    for other in (0.9999 * getattr(ours, plane), 1.0001 * getattr(ours, plane)):
        theirs = load(seen_by(ours.model_copy(update={plane: other})))
        assert compare_camera(seen_by(ours), theirs, 200).problem.startswith("the camera: ")
    without = load(seen_by(ours.model_copy(update={plane: getattr(camera, plane)})))
    assert compare_camera(seen_by(ours), without, 200).problem.startswith("the camera: ")
    with_one = load(seen_by(camera.model_copy(update={plane: getattr(ours, plane)})))
    assert compare_camera(seen_by(camera), with_one, 200).problem.startswith("the camera: ")


def test_a_picture_of_one_pixel_is_compared() -> None:
    """Its only ray may be straight ahead: the bound looks at the corners."""
    for camera in (Perspective(**TILTED, fov=179.0), LENS, BOX):
        scene = seen_by(camera, (1, 1))
        assert compare_camera(scene, load(scene), 200).problem == ""


@pytest.mark.parametrize("camera", [FRONTAL, BOX, LENS, Orthographic(**TILTED, view=OFF_AXIS)])
def test_what_the_cameras_see(camera: AnyCamera) -> None:
    scene = seen_by(camera)
    rung = geometry(scene, build_tables(scene), load(scene), pixels=500)
    assert rung.status == "agree", rung.reason


def test_rounded_edges_are_square_enough() -> None:
    """A third of a picture in decimals: not square to the last bit of float64."""
    for edges in ((-0.3, 0.6, -0.1, 0.5), (0.1, 0.4, 0.7, 0.9), (-0.1, 0.2, 0.1, 0.3)):
        assert to_mitsuba(seen_by(Perspective(view=edges)))["sensor"]["fov_axis"] == "x"
