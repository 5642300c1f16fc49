"""`reference-rt preview`: to a file, to a terminal, to a window that is closed."""

import functools
import os
import re
import shutil
import subprocess

import numpy as np
import pytest
from builders import SCENES
from command_line import invoke
from PIL import Image, ImageGrab

import reference_rt as rt
from reference_rt.cli import preview as previews

BOX = str(SCENES / "cornell_box.yaml")
SMALL = ("--size", "12x8", "--spp", "4")


def run(*arguments):
    return invoke("preview", BOX, *SMALL, *arguments)


def test_a_file_is_rewritten(tmp_path):
    out = tmp_path / "new" / "a.png"
    done = run("--to", out)
    assert done.exit_code == 0, done.stderr
    assert done.stdout == ""
    lines = [line for line in done.stderr.splitlines() if not line.startswith("compiling")]
    assert lines[0] == f"{out}: 1 sample per pixel"
    assert lines[-1] == f"{out}: 4 samples per pixel"
    assert list(out.parent.iterdir()) == [out]
    image = Image.open(out)
    assert image.size == (12, 8)
    assert image.text["scene"] == "cornell_box"


def test_without_a_display_the_file_is_beside_the_caller(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(previews, "_window", lambda scene: None)
    assert run().exit_code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["cornell_box.preview.png"]


def test_little_noise_ends_it(tmp_path):
    done = run("--to", tmp_path / "a.png", "--spp", "1024", "--target-error", "50%")
    assert done.exit_code == 0, done.stderr
    last = re.search(r": (\d+) samples per pixel, relative error ([\d.]+) ?%$", done.stderr.strip())
    assert last, done.stderr
    assert 16 < int(last[1]) < 1024
    assert 0.0 < float(last[2]) <= 50.0


@pytest.mark.parametrize("place", ["terminal", "blocks", "sixel", "kitty"])
def test_a_terminal_is_cleared_once(place):
    done = run("--to", place)
    assert done.exit_code == 0
    assert done.stdout.count("\x1b[2J") == 1
    assert done.stdout.count("\x1b[H") == done.stdout.count("per pixel") >= 2
    drawn = {"kitty": "\x1b_G", "sixel": "\x1bPq", "blocks": "▀", "terminal": "▀"}[place]
    assert done.stdout.count(drawn) >= 2


@pytest.mark.parametrize(
    ("to", "said"),
    [
        ("a.jpg", "--to: expected one of window, terminal, kitty, sixel, blocks or a .png file"),
        ("screen", "--to: expected one of window, terminal, kitty, sixel, blocks or a .png file"),
        ("window", "--to window: there is no display"),
    ],
)
def test_wrong_places(to, said, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    done = run("--to", to)
    assert done.exit_code == 2
    assert done.stderr.startswith(f"error: {said}")


class Root:
    """A `tkinter.Tk` that the user closes after some updates."""

    def __init__(self, updates):
        self.updates, self.titles, self.ended = updates, [], False

    def title(self, text):
        self.titles.append(text)

    def protocol(self, name, function):
        assert name == "WM_DELETE_WINDOW"
        self.function = function

    def bind(self, key, function):
        self.escape = function

    def update(self):
        self.updates -= 1
        if self.updates == 0:
            self.function()

    def after(self, milliseconds):
        assert milliseconds > 0

    def destroy(self):
        self.ended = True


class Label:
    def __init__(self, root, **options):
        self.shown = []

    def pack(self):
        pass

    def configure(self, image):
        self.shown.append(image)


@pytest.mark.parametrize("updates", [1, 3, 200])
def test_a_window_that_is_closed_ends_it(updates, monkeypatch):
    pytest.importorskip("tkinter")
    monkeypatch.setattr("tkinter.Label", Label)
    monkeypatch.setattr("PIL.ImageTk.PhotoImage", lambda image, master: np.asarray(image))
    root = Root(updates)
    window = previews.Window(root, "box")
    scene = rt.Scene.load(BOX)
    film = scene.film.model_copy(update={"width": 12, "height": 8})
    previews.preview(scene.changed(film=film), window, previews.Wanted(4, 0.0, 1))
    assert root.ended
    shown = window._label.shown
    assert all(image.shape == (8, 12, 3) for image in shown)
    if updates == 200:  # the picture was finished, and the window was left open
        assert "4 samples" in root.titles[-1]


class Author:
    """A view whose user edits a file after each picture, and closes it after the last one.

    edits: functions that change files;  seen: the mean of each new picture.
    """

    def __init__(self, *edits):
        self.edits, self.seen, self.is_new = list(edits), [], False

    def show(self, picture):
        mean = float(picture.colour.mean())
        if self.seen[-1:] != [mean]:  # a picture may be shown twice
            self.seen.append(mean)
            self.is_new = True

    def pump(self):
        if self.is_new:
            self.is_new = False
            if not self.edits:
                raise previews.Closed
            self.edits.pop(0)()


def test_a_scene_that_is_watched_is_shown_again(tmp_path, monkeypatch):
    """After an edit of the scene, of a file that it names, and of one that was wrong meanwhile."""
    path, sky = tmp_path / "a.yaml", tmp_path / "sky.npy"
    begin = (
        "camera: {type: perspective}\nfilm: {width: 2, height: 2}\nintegrator: {type: whitted}\n"
    )

    def write(text):
        path.write_text(f"{begin}lights: [{text}]\n")

    def glow(value):
        np.save(sky, np.full((2, 4, 3), value, np.float32))

    said = []

    def say(text, err):
        said.append(text)
        write("{type: constant, radiance: 50}")

    monkeypatch.setattr(previews, "say", say)
    glow(1.0)
    write("{type: constant, radiance: 3}")
    edits = (
        lambda: write("{type: environment_map, file: sky.npy}"),
        lambda: glow(7.0),
        lambda: write("{type: lamp}"),
    )
    view = Author(*edits)
    load = functools.partial(rt.Scene.load, path)
    previews.watch(load, path, view, previews.Wanted(1, 0.0, 1))
    assert view.seen == [3.0, 1.0, 7.0, 50.0]
    assert len(said) == 1
    assert "unknown type 'lamp'" in said[0]


@pytest.fixture
def display(monkeypatch):
    """A display that nobody sees."""
    pytest.importorskip("tkinter")
    server = shutil.which("Xvfb") or pytest.skip("Xvfb is not installed")
    reader, writer = os.pipe()
    command = [server, "-displayfd", str(writer), "-screen", "0", "64x48x24"]
    with subprocess.Popen(command, pass_fds=[writer], stderr=subprocess.DEVNULL) as process:
        os.close(writer)
        with os.fdopen(reader) as file:
            name = f":{file.readline().strip()}"
        monkeypatch.setenv("DISPLAY", name)
        yield name
        process.terminate()


def test_a_window_shows_the_pixels(display):
    scene = rt.Scene.load(SCENES / "spheres_whitted.yaml").changed(film=rt.Film(width=12, height=8))
    window = previews.view_of("window", scene)
    picture = rt.render(scene)
    window.show(picture)
    assert window._root.title() == f"spheres_whitted: {previews.words(picture)}"
    x, y = window._label.winfo_rootx(), window._label.winfo_rooty()
    screen = np.asarray(ImageGrab.grab(xdisplay=display).convert("RGB"))
    assert (screen[y : y + 8, x : x + 12] == previews.pixels_of(picture)).all()
    window._root.focus_force()  # as a window manager does
    window._root.event_generate("<Escape>")
    with pytest.raises(previews.Closed):
        window.pump()


def test_the_pixels_are_those_of_render(tmp_path):
    """Of a scene without noise, so that both have the same picture."""
    common = SCENES / "spheres_whitted.yaml", "--size", "9x6"
    shown, rendered = tmp_path / "a.png", tmp_path / "b.png"
    assert invoke("preview", *common, "--to", shown).exit_code == 0
    assert invoke("render", *common, "-o", rendered).exit_code == 0
    assert (np.asarray(Image.open(shown)) == np.asarray(Image.open(rendered))).all()
