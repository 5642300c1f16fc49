"""Every file that a scene or a command line names may be no file at all, endless, enormous, or have
a name that a terminal obeys: one line, soon, and never an internal error."""

import os
import signal
import socket
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke

import reference_rt as rt
from comparisons.gate.baselines import used_in
from comparisons.gate.digest import scene_digest
from comparisons.gate.pictures_in import read_candidate, variance_of
from comparisons.report.templates import around
from comparisons.results.stored_case import CASE, read_stored_case
from comparisons.suites.keys import files_digest
from comparisons.suites.run import read_stored_results
from comparisons.suites.suite import load_suite
from reference_rt.core.exr import read_exr
from reference_rt.scene.build import build_tables
from reference_rt.shapes.meshes.files import other
from reference_rt.util.errors import ReferenceRtError
from reference_rt.util.files import MOST_BYTES, MOST_TEXT, open_input, read_input, read_text

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs pipes and devices by name")

SECONDS = 600
"""In which each must end: most take milliseconds, and reading a pipe would never end."""


def mesh(path: Path) -> None:
    build_tables(rt.Scene(shapes=(rt.Mesh(file=str(path)),)))


def buffer_of_mesh(path: Path) -> None:
    document = '{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], '
    document += '"meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "accessors": '
    document += '[{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}], '
    document += '"bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": '
    document += f'[{{"byteLength": 36, "uri": "{path.name}"}}]}}'
    (path.parent / "mesh.gltf").write_text(document)
    mesh(path.parent / "mesh.gltf")


def record_of_case(path: Path) -> None:
    (path.parent / CASE).symlink_to(path)
    read_stored_case(path.parent)


def results_of_suite(path: Path) -> None:
    (path.parent / "results.json").symlink_to(path)
    read_stored_results(path.parent)


READERS = {
    "scene.yaml": rt.Scene.load,
    "scene.json": rt.Scene.load,
    "scene.gltf": rt.Scene.load,
    "scene.glb": rt.Scene.load,
    **{f"mesh{suffix}": mesh for suffix in (".obj", ".ply", ".stl", ".off", ".glb", ".gltf")},
    **{f"mesh{suffix}": mesh for suffix in other.suffixes()},
    "buffer.bin": buffer_of_mesh,
    "texture.png": lambda path: build_tables(
        rt.Scene(textures={"t": rt.Bitmap(file=str(path))})
    ),
    "sky.exr": lambda path: build_tables(rt.Scene(lights=(rt.EnvironmentMap(file=str(path)),))),
    "candidate.pfm": read_candidate,
    "variance.exr": variance_of,
    "picture.exr": read_exr,
    "suite.yaml": lambda path: load_suite(str(path)),
    "told.json": record_of_case,
    "found.json": results_of_suite,
    "README.md": lambda path: around(path, "table"),
}  # fmt: skip


def make_pipe(path: Path) -> None:
    os.mkfifo(path)


def make_socket(path: Path) -> None:
    # Its address has room for a hundred bytes only, fewer than the test's folder has.
    here = Path.cwd()
    os.chdir(path.parent)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(path.name)
    os.chdir(here)


def make_enormous(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(1 << 42)  # it takes no place on the disk


def leave_a_pointer(path: Path) -> None:
    """What a repository cloned without Git LFS has in place of a large file."""
    digest = "f789764840e53deb1a07d2fa1953124d6bc29b9f8d1308e97dd2d07c59d598bd"
    path.write_text(
        f"version https://git-lfs.github.com/spec/v1\noid sha256:{digest}\nsize 184302\n"
    )


KINDS = {
    "missing": lambda path: None,
    "empty": lambda path: path.touch(),
    "a folder": lambda path: path.mkdir(),
    "a pipe": make_pipe,
    "a socket": make_socket,
    "endless": lambda path: path.symlink_to("/dev/zero"),
    "full": lambda path: path.symlink_to("/dev/full"),
    "a terminal": lambda path: path.symlink_to("/dev/tty"),
    "a circle": lambda path: path.symlink_to(path),
    "a broken link": lambda path: path.symlink_to(path.parent / "nowhere"),
    "enormous": make_enormous,
    "a pointer": leave_a_pointer,
    "rubbish": lambda path: path.write_bytes(bytes(range(256)) * 8),
    "not for reading": lambda path: path.symlink_to("/proc/self/mem"),
}


@pytest.fixture(autouse=True)
def _soon():
    def late(*_):
        raise AssertionError(f"did not end within {SECONDS} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(SECONDS)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.cases(271)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", READERS)
def test_every_reader_of_everything(tmp_path, name, kind):
    path = tmp_path / name
    KINDS[kind](path)
    if (name, kind) == ("buffer.bin", "rubbish"):
        READERS[name](path)  # any bytes are three points
        return
    with pytest.raises(ReferenceRtError) as caught:
        READERS[name](path)
    said = str(caught.value)
    assert said.isprintable()
    assert str(tmp_path) in said
    assert caught.value.exit_code in (2, 3, 4)
    if kind == "a pipe":
        assert "is a pipe, not a regular file" in said
    if kind == "a pointer":
        assert "is a Git LFS pointer; run `git lfs pull`" in said
    if kind == "enormous" and name in ("scene.yaml", "scene.json", "suite.yaml", "told.json"):
        assert f"has more than {MOST_TEXT} bytes" in said
    if kind == "enormous" and name.startswith("mesh"):
        assert f"has more than {MOST_BYTES} bytes" in said


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in ("rubbish", "empty")])
def test_digests_of_files_that_are_none(tmp_path, kind):
    """One says so; the other leaves it to who loads the scene."""
    KINDS[kind](tmp_path / "a.gltf")
    scene = rt.Scene(shapes=(rt.Mesh(file=str(tmp_path / "a.gltf")),))
    with pytest.raises(rt.SceneError, match="cannot be read: "):
        files_digest(scene)
    assert scene_digest(scene)
    (tmp_path / "results.json").symlink_to(tmp_path / "a.gltf")
    assert used_in(tmp_path) == set()


def test_files_are_read_whole(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"\xc3\xa9\n" * 1000)
    assert read_input(path) == path.read_bytes()
    assert read_input(path, 3000) == path.read_bytes()
    assert read_text(path) == "é\n" * 1000
    with pytest.raises(OSError, match="has more than 2999 bytes"):
        read_input(path, 2999)
    with open_input(path) as file:
        assert not os.get_inheritable(file.fileno())
        assert file.read(2) == b"\xc3\xa9"
    # Without a size of its own, and as many bytes as somebody asks for.
    assert read_input(Path("/proc/self/status")).startswith(b"Name:")


# ---- names --------------------------------------------------------------------------------------

NAMES = {
    "not UTF-8": "caf\udce9",
    "a terminal's code": "\x1b[31mred",
    "a new line": "two\nlines",
    "no characters": "\x00\ufffe\u202e" .replace("\x00", "\x9b"),
}  # fmt: skip

COMMANDS = (
    ("render", "{}.yaml", "-o", "out.png"),
    ("render", "good.yaml", "-o", "{}.txt"),
    ("explain", "{}.yaml"),
    ("explain", "{}.json"),
    ("compare", "{}.yaml"),
    ("suite", "{}.yaml"),
    ("suite", "smoke", "--scenes", "{}"),
    ("suite", "smoke", "--only", "{}"),
    ("report", "{}"),
    ("gate", "{}.exr", "--reference", "good.exr"),
    ("gate", "good.exr", "--reference", "{}.exr"),
    ("gate", "good.exr", "--baseline", "{}"),
    ("gate", "--command", "{} {{output}}", "--reference", "good.exr"),
    ("accept", "{}.exr", "--name", "a", "--reason", "b"),
    ("accept", "good.exr", "--name", "{}", "--reason", "b"),
    ("converge", "{}.yaml"),
    ("bench", "--scenes", "{}"),
    ("selftest", "--scenes", "{}"),
    ("{}",),
)


@pytest.mark.cases(10)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_every_command_and_every_name(tmp_path, monkeypatch, command, name):
    """Printed in UTF-8, and nothing that a terminal obeys."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("CI", raising=False)
    (tmp_path / "good.yaml").write_text("shapes: [{type: sphere}]\n")
    arguments = [word.format(NAMES[name]) if "{" in word else word for word in command]
    result = invoke(*arguments)
    assert result.exit_code in (2, 3, 4), result.output
    for told in (result.stdout, result.stderr):
        assert all(c.isprintable() or c in "\n" for c in told), told
    assert "internal error" not in result.stderr


# ---- archives -----------------------------------------------------------------------------------


def test_deep_and_foreign_json(tmp_path):
    """Where records are expected: nested without end, of other types, not text."""
    for content in (b"[" * 100_000, b"[]", b"1", b"null", b'{"cases": 3}', b"\xff\xfe", b'"a"'):
        for name, read in ((CASE, read_stored_case), ("results.json", read_stored_results)):
            (tmp_path / name).write_bytes(content)
            with pytest.raises(ReferenceRtError):
                read(tmp_path)
        assert used_in(tmp_path) == set()


def test_arrays_that_are_objects_never_run(tmp_path):
    """A NumPy file may hold pickled objects, which are code."""
    np.save(tmp_path / "a.npy", np.array([{}], dtype=object), allow_pickle=True)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.write(tmp_path / "a.npy", "a.npy")
    for name in ("a.npy", "a.npz"):
        with pytest.raises(ReferenceRtError):
            read_candidate(tmp_path / name)
        with pytest.raises(rt.SceneError):
            build_tables(rt.Scene(textures={"t": rt.Bitmap(file=str(tmp_path / name))}))
