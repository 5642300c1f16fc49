"""Cameras: their rays against the textbook's formulas; descriptions."""

import math

import numpy as np
import pytest
from builders import U, unit_vectors
from camera_checks import CAMERAS, LENSES, POINTS, STRAIGHT, TILTED, VIEW, centres, local, rays

import reference_rt as rt
from reference_rt.cameras import Pinhole, ThinLens


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_directions_are_unit(camera):
    for lens in LENSES:
        _, d = rays(camera, POINTS, lens=lens)
        assert np.abs(np.linalg.norm(d, axis=1) - 1).max() < 8 * U


# ---- the view rectangle -------------------------------------------------------------------------


@pytest.mark.parametrize("placed", [STRAIGHT, TILTED])
@pytest.mark.parametrize(("n_x", "n_y"), [(8, 5), (3, 3), (2, 7), (1, 1)])
def test_perspective_is_the_text_books(placed, n_x, n_y):
    """T3: d = s - e, u_s = l + (r - l)(i + 1/2) / n_x, v_s likewise, at distance 2.5."""
    l, r, b, t = VIEW
    camera = rt.Perspective(**placed, view=VIEW, distance=2.5)
    o, d = rays(camera, centres(n_x, n_y), (n_x, n_y))
    assert (o == camera.eye).all()
    found = local(camera, d)
    found *= (2.5 / found[:, 2])[:, None]
    i, j = np.arange(n_x), np.arange(n_y)
    u_s = np.tile(l + (r - l) * (i + 0.5) / n_x, n_y)
    v_s = np.repeat(b + (t - b) * (n_y - 1 - j + 0.5) / n_y, n_x)  # row 0 is the top
    assert np.abs(found[:, 0] - u_s).max() < 32 * U
    assert np.abs(found[:, 1] - v_s).max() < 32 * U


@pytest.mark.parametrize("placed", [STRAIGHT, TILTED])
@pytest.mark.parametrize(("n_x", "n_y"), [(8, 5), (2, 7), (1, 1)])
def test_orthographic_is_the_text_books(placed, n_x, n_y):
    """T2: rays start on the rectangle and go forward."""
    l, r, b, t = -3.0, 1.0, 0.5, 2.0
    camera = rt.Orthographic(**placed, view=(l, r, b, t))
    o, d = rays(camera, centres(n_x, n_y), (n_x, n_y))
    assert np.abs(local(camera, d) - [0, 0, 1]).max() < 4 * U
    assert (d == d[0]).all()
    found = local(camera, o - np.array(camera.eye))
    i, j = np.arange(n_x), np.arange(n_y)
    u_s = np.tile(l + (r - l) * (i + 0.5) / n_x, n_y)
    v_s = np.repeat(b + (t - b) * (n_y - 1 - j + 0.5) / n_y, n_x)
    # The eye's coordinates are up to 5, the sums up to 10.
    expected = np.column_stack([u_s, v_s, np.zeros(n_x * n_y)])
    assert np.abs(found - expected).max() < 16 * 10 * U


@pytest.mark.parametrize("make", [rt.Perspective, rt.Orthographic])
def test_the_corners_of_the_rectangle(make):
    l, r, b, t = -0.25, 0.75, -1.5, 0.5  # powers of two: exact
    o, d = rays(make(**STRAIGHT, view=(l, r, b, t)), [[0, 0], [1, 0], [0, 1], [1, 1], [0.5, 0.5]])
    place = o[:, :2] if make is rt.Orthographic else d[:, :2] / -d[:, 2:]
    corners = np.array([[l, t], [r, t], [l, b], [r, b], [(l + r) / 2, (b + t) / 2]])
    assert np.abs(place - corners).max() < 8 * U
    assert (np.sign(d[:, 2]) == -1).all()


def angle_between(camera, size, one, other):
    """Degrees between the rays of two film points: exact also where they are near."""
    _, (a, b) = rays(camera, [one, other], size)
    return math.degrees(2 * math.atan2(np.linalg.norm(a - b), np.linalg.norm(a + b)))


@pytest.mark.parametrize("make", [rt.Perspective, lambda **k: ThinLens(aperture_radius=1, **k)])
@pytest.mark.parametrize("fov", [0.01, 45, 90, 140, 179])
def test_what_the_field_of_view_spans(make, fov):
    left, right, top, bottom = (0, 0.5), (1, 0.5), (0.5, 0), (0.5, 1)
    for size in ((8, 6), (6, 8), (1, 50), (5, 5)):

        def angles(axis, size=size):
            camera = make(**TILTED, fov=fov, fov_axis=axis)
            pairs = {"x": (left, right), "y": (top, bottom), "diagonal": ((0, 0), (1, 1))}
            return {name: angle_between(camera, size, *pair) for name, pair in pairs.items()}

        for axis in ("x", "y", "diagonal"):
            assert angles(axis)[axis] == pytest.approx(fov, rel=1e-12)
        wide = size[0] > size[1]
        assert angles("smaller") == angles("y" if wide else "x")
        assert angles("larger") == angles("x" if wide else "y")


def test_pixels_by_angle_are_square():
    for axis in ("x", "y", "diagonal", "smaller", "larger"):
        camera = rt.Perspective(**STRAIGHT, fov=80, fov_axis=axis)
        _, d = rays(camera, [[0.5, 0.5], [0.5 + 1 / 8, 0.5], [0.5, 0.5 - 1 / 6]], (8, 6))
        step = d[:, :2] / -d[:, 2:]
        assert step[1, 0] == pytest.approx(step[2, 1], rel=1e-14)


def test_what_stands_in_for_nothing_given():
    def view(camera):
        return camera.setup(8, 6)

    assert view(rt.Perspective()) == view(rt.Perspective(fov=45, fov_axis="x"))
    assert view(rt.Perspective(fov_axis="y")) == view(rt.Perspective(fov=45, fov_axis="y"))
    assert view(rt.Perspective(view=VIEW)) == view(rt.Perspective(view=VIEW, distance=1))
    assert view(rt.Orthographic()) == view(rt.Orthographic(width=2))
    lens = {"target": (0, 0, -3), "aperture_radius": 0.1}
    assert view(ThinLens(**lens)) == view(ThinLens(**lens, focus_distance=4))


def test_angle_and_rectangle_agree():
    half = math.tan(math.radians(35))
    by_view = rt.Perspective(**TILTED, view=(-half, half, -half * 3 / 4, half * 3 / 4))
    for one, other in zip(
        rays(rt.Perspective(**TILTED, fov=70), POINTS), rays(by_view, POINTS), strict=True
    ):
        assert np.abs(one - other).max() < 8 * U
    by_width = rt.Orthographic(**TILTED, width=3)
    by_view = rt.Orthographic(**TILTED, view=(-1.5, 1.5, -1.125, 1.125))
    assert by_width.setup(8, 6) == by_view.setup(8, 6)


@pytest.mark.parametrize("factor", [2.0**-200, 2.0**300])
def test_the_size_of_rectangle_and_film_does_not_count(factor):
    """Scaled by a power of two, with its distance: the same bits."""
    scaled = tuple(factor * x for x in VIEW)
    one = rt.Perspective(**TILTED, view=VIEW, distance=0.7)
    other = rt.Perspective(**TILTED, view=scaled, distance=0.7 * factor)
    assert one.setup(8, 6) == other.setup(8, 6)
    one = Pinhole(**TILTED, film_width=0.3, film_distance=0.7)
    other = Pinhole(**TILTED, film_width=0.3 * factor, film_distance=0.7 * factor)
    assert one.setup(8, 6) == other.setup(8, 6)


# ---- the real pinhole ---------------------------------------------------------------------------


@pytest.mark.parametrize("placed", [STRAIGHT, TILTED])
def test_pinhole_rays_come_from_the_film_through_the_hole(placed):
    width, distance, n_x, n_y = 0.3, 0.2, 8, 6
    camera = Pinhole(**placed, film_width=width, film_distance=distance)
    u, v, w = camera.basis
    x, y = POINTS.T
    eye = np.array(camera.eye)
    right, up = width * (x - 0.5), width * n_y / n_x * (0.5 - y)
    film = eye + right[:, None] * u + up[:, None] * v + distance * w
    o, d = rays(camera, POINTS, (n_x, n_y))
    assert (o == eye).all()  # the box around the film hides what lies in it
    through = (eye - film) / np.linalg.norm(eye - film, axis=1)[:, None]
    # The film's points are rounded beside the eye, up to 5, over 0.2.
    assert np.abs(d - through).max() < 16 * U * 5 / distance


def test_the_pinholes_picture_is_inverted_and_mirrored():
    """Up on the film is down in the scene, right is left: turned by 180 degrees."""
    _, d = rays(Pinhole(**STRAIGHT), [[0.5, 0], [0.5, 1], [0, 0.5], [1, 0.5], [0.5, 0.5]])
    assert d[0, 1] < 0 < d[1, 1]
    assert d[3, 0] < 0 < d[2, 0]
    assert d[4].tolist() == [0, 0, -1]
    simplified = rt.Perspective(**TILTED, fov=math.degrees(2 * math.atan(0.75)))
    _, turned = rays(simplified, 1 - POINTS)
    _, d = rays(Pinhole(**TILTED, film_width=0.3, film_distance=0.2), POINTS)
    assert np.abs(d - turned).max() < 16 * U


def test_a_pinholes_picture():
    """A ball to the right and above shows to the left and below; one in the box does not."""
    ball, inside = rt.Sphere(center=(1.5, 0.5, 0), radius=0.25), rt.Sphere(center=(0, 0, 4.5))
    scene = rt.Scene(
        camera=Pinhole(eye=(0, 0, 3), film_width=4, film_distance=3),
        film=rt.Film(width=4, height=4),
        integrator=rt.RayCast(),
        shapes=(ball, inside.model_copy(update={"radius": 1.0})),
    )
    ids = rt.render(scene).layers["id"]
    assert np.argwhere(ids == 0).tolist() == [[2, 0]]
    assert not (ids == 1).any()


# ---- descriptions -------------------------------------------------------------------------------

WRONG = {
    "both": ("type: perspective, fov: 40, view: [-1, 1, -1, 1]", "", "both 'fov' and 'view'"),
    "axis of a rectangle": (
     "type: thin_lens, aperture_radius: 1, fov_axis: y, view: [-1, 1, -1, 1]", "",
     "both 'fov_axis' and 'view'"),
    "distance alone": ("type: perspective, distance: 2", "", "'distance' is that of 'view'"),
    "width and view": ("type: orthographic, width: 2, view: [0, 1, 0, 1]", "", "both 'width' and"),
    "l = r": ("type: perspective, view: [1, 1, 0, 1]", ".view", "expected [l, r, b, t] with l < r"),
    "b > t": ("type: orthographic, view: [0, 1, 3, 2]", ".view", "with b < t, got 3 and 2"),
    "three edges": ("type: perspective, view: [0, 1, 0]", ".view", "expected four numbers"),
    "a word": ("type: perspective, view: [0, one, 0, 1]", ".view", "expected four numbers"),
    "a truth": ("type: perspective, view: [0, true, 0, 1]", ".view", "expected four numbers"),
    "a number": ("type: orthographic, view: 3", ".view", "expected four numbers"),
    "NaN": ("type: orthographic, view: [0, .nan, 0, 1]", ".view", "with l < r, got 0 and nan"),
    "infinite": ("type: orthographic, view: [0, .inf, 0, 1]", ".view", "of finite size"),
    "long": (f"type: orthographic, view: [0, 1{'0' * 400}, 0, 1]", ".view", "expected finite"),
    "endless": ("type: perspective, view: [-1e308, 1e308, 0, 1]", ".view", "of finite size"),
    "zero distance": ("type: perspective, view: [0, 1, 0, 1], distance: 0", ".distance",
     "expected"),
    "a point": ("type: perspective, view: [0, 1.0e-200, 0, 1], distance: 1.0e+200", "",
     "the distance makes the rectangle a point"),
    "180 degrees": ("type: perspective, view: [0, 1, 0, 1], distance: 1.0e-17", "",
     "the rectangle fills all 180 degrees"),
    "unknown axis": ("type: perspective, fov_axis: z", ".fov_axis", "expected 'x', 'y', 'diag"),
    "flat angle": ("type: thin_lens, aperture_radius: 1, fov: 180", ".fov", "expected less than"),
    "no film": ("type: pinhole, film_width: 0", ".film_width", "expected greater than 0"),
    "film in the hole": ("type: pinhole, film_distance: -1", ".film_distance", "expected greater"),
    "film beside the hole": ("type: pinhole, film_distance: 1.0e-17", "", "the rectangle fills"),
    "hole of no size": ("type: pinhole, hole_radius: 0", ".hole_radius", "expected greater than 0"),
    "light through a point": ("type: pinhole, exposure: 1", "", "expected 'hole_radius' too"),
    "wide hole": ("type: pinhole, hole_radius: 1, film_distance: 1.0e-16, film_width: 1.0e-16", "",
                  "the hole is too wide"),
    "no lens": ("type: thin_lens", ".aperture_radius", "missing; expected"),
    "empty lens": ("type: thin_lens, aperture_radius: 0", ".aperture_radius", "expected greater"),
    "focus in the lens": ("type: thin_lens, aperture_radius: 1, focus_distance: 0",
     ".focus_distance", "expected greater than 0"),
    "wide lens": ("type: thin_lens, aperture_radius: 1, focus_distance: 1.0e-17", "",
     "the lens is too wide"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "keys", "told"), WRONG.values(), ids=WRONG)
def test_wrong_cameras(text, keys, told):
    with pytest.raises(rt.SceneError) as caught:
        rt.Scene.parse("film: {}\ncamera: {" + text + "}", "wrong.yaml")
    line = str(caught.value)
    assert line.startswith(f"wrong.yaml:2: camera{keys}: ")
    assert told in line
    assert "expected" in line
    assert "\n" not in line


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_files_hold_every_camera(camera):
    scene = rt.Scene(camera=camera)
    for text in (scene.to_yaml(), scene.to_json()):
        again = rt.Scene.parse(text)
        assert again == scene
        assert again.camera.setup(8, 6) == camera.setup(8, 6)


def test_the_schema_says_what_a_view_is():
    view = rt.json_schema()["$defs"]["Perspective"]["properties"]["view"]
    array, _ = view["anyOf"]
    assert (array["minItems"], array["maxItems"]) == (4, 4)
    assert "[left, right, bottom, top]" in view["description"]


def test_no_direction_is_ever_nan():
    """The steepest, flattest, nearest and farthest that is accepted."""
    rng = np.random.default_rng(84)
    tops = [2.0**53, 1e15, 1.0, 1e-150]
    for camera in [
        *(rt.Perspective(**TILTED, view=(-s, s, -s, s)) for s in tops),
        rt.Perspective(**TILTED, fov=np.nextafter(180, 0)),
        ThinLens(**TILTED, fov=179.9, aperture_radius=1e200, focus_distance=1e190),
        ThinLens(**TILTED, aperture_radius=1e-320, focus_distance=1e-320),
        ThinLens(**TILTED, aperture_radius=1, focus_distance=1e308),
        Pinhole(**TILTED, film_width=1e300, film_distance=1e290),
        Pinhole(**TILTED, film_width=1e300, film_distance=1e290, hole_radius=1e300),
        Pinhole(**TILTED, hole_radius=1e-320),
    ]:
        for size in ((8, 6), (1, 2**31 - 1)):
            for lens in LENSES:
                _, d = rays(camera, rng.uniform(0, 1, (20, 2)), size, lens)
                assert np.abs(np.linalg.norm(d, axis=1) - 1).max() < 8 * U


def test_vectors_are_three_floats():
    """Kernels are compiled for floats: integers would be other types, and compile again."""
    for camera in (rt.Perspective(**STRAIGHT), ThinLens(**STRAIGHT, aperture_radius=1)):
        for part in camera.setup(8, 6):
            for number in part if isinstance(part, tuple) else [part]:
                assert type(number) is float


def test_any_basis():
    """The same camera, moved and turned: the same coordinates along its own axes."""
    rng = np.random.default_rng(85)
    _, expected = rays(rt.Perspective(**STRAIGHT, view=VIEW), POINTS)
    for target, up in zip(unit_vectors(rng, 20), unit_vectors(rng, 20), strict=True):
        camera = rt.Perspective(eye=(0, 0, 0), target=tuple(target), up=tuple(up), view=VIEW)
        _, d = rays(camera, POINTS)
        # The basis itself is off by u over the sine between up and the axis.
        sine = np.linalg.norm(np.cross(target, up))
        assert np.abs(local(camera, d) * [1, 1, -1] - expected).max() < 16 * U / sine
