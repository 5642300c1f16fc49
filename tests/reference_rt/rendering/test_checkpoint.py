"""Files of a checkpoint: exact, and never used if they are damaged, alien or older."""

import os
import random
import shutil
import time

import numpy as np
import pytest
from builders import SCENES

import reference_rt as rt
from reference_rt.rendering import checkpoint
from reference_rt.rendering.checkpoint import Band, Checkpoint, render_digest
from reference_rt.rendering.noise import COLUMNS
from reference_rt.util.errors import ImageError

DIGEST = bytes(range(32))


def store(folder, digest=DIGEST, resume=True):
    return Checkpoint(folder, lambda: digest, resume)


def band(seed=1, pixels=256):
    rng = np.random.default_rng(seed)
    sums = {"colour": rng.normal(size=(pixels, 3)), "id": rng.normal(size=(pixels, 1))}
    return Band(sums, rng.integers(0, 99, pixels // 64), rng.normal(size=(pixels // 64, COLUMNS)))


def empty(pixels=256):
    one = band(1, pixels)
    sums = {name: np.zeros_like(array) for name, array in one.sums.items()}
    return Band(sums, np.zeros_like(one.done), np.zeros_like(one.statistics))


def same(a, b):
    return (
        a.done.tobytes() == b.done.tobytes()
        and a.statistics.tobytes() == b.statistics.tobytes()
        and all(a.sums[name].tobytes() == b.sums[name].tobytes() for name in b.sums)
    )


def test_what_is_written_is_read(tmp_path):
    one = band()
    one.sums["colour"][0] = np.nan, np.inf, -0.0
    store(tmp_path).write(3, one)
    assert same(store(tmp_path).read(3, empty()), one)
    assert store(tmp_path).read(2, empty()) is None


def test_without_resume_only_own_files_are_read(tmp_path):
    store(tmp_path).write(0, band(1))
    fresh = store(tmp_path, resume=False)
    assert fresh.read(0, empty()) is None
    assert fresh.exists()
    assert not fresh.is_used
    assert store(tmp_path).is_used
    assert not store(tmp_path / "elsewhere").is_used
    fresh.write(0, band(2))
    assert fresh.is_used
    assert same(fresh.read(0, empty()), band(2))


def test_500_mutations(tmp_path):
    """Bits, bytes, lengths, holes, and parts of other files: never used."""
    first = store(tmp_path)
    first.write(0, band(1))
    first.write(1, band(2))
    file = first.path(0)
    right, other = file.read_bytes(), first.path(1).read_bytes()
    choose = random.Random(24)
    for k in range(500):
        content = bytearray(right)
        at, count = choose.randrange(len(content)), choose.randrange(1, 4096)
        match k % 6:
            case 0:
                content[at] ^= 1 << choose.randrange(8)
            case 1:
                del content[at:]
            case 2:
                content += choose.randbytes(count)
            case 3:
                content[at : at + count] = bytes(len(content[at : at + count]))
            case 4:
                content[at:] = other[at:]
            case 5:
                del content[at : at + count]
        file.write_bytes(content)
        assert content != right
        assert first.read(0, empty()) is None, k
    file.write_bytes(right)
    assert same(first.read(0, empty()), band(1))


def test_alien_files(tmp_path):
    """Of another render, another band, another size: each is whole by itself."""
    other = store(tmp_path, b"\1" * 32)
    own = store(tmp_path)
    other.write(0, band())
    own.folder.mkdir()
    shutil.copy(other.path(0), own.path(0))
    assert own.read(0, empty()) is None
    own.write(0, band())
    shutil.copy(own.path(0), own.path(1))
    assert own.read(1, empty()) is None
    assert own.read(0, empty(512)) is None
    assert own.read(0, empty(128)) is None


@pytest.mark.parametrize("kind", ["folder", "pipe", "device", "nowhere", "loop"])
def test_what_is_no_file(kind, tmp_path):
    own = store(tmp_path)
    own.folder.mkdir()
    path = own.path(0)
    match kind:
        case "folder":
            path.mkdir()
        case "pipe":
            os.mkfifo(path)
        case "device":
            path.symlink_to("/dev/zero")
        case "nowhere":
            path.symlink_to(tmp_path / "nowhere")
        case "loop":
            path.symlink_to(path)
    assert own.read(0, empty()) is None


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("a file")
    with pytest.raises(ImageError, match="cannot be written"):
        store(tmp_path / "file").write(0, band())


def test_a_write_that_fails_leaves_the_former_file(tmp_path, monkeypatch):
    own = store(tmp_path)
    own.write(0, band(1))

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("reference_rt.util.files.os.fsync", full)
    with pytest.raises(ImageError, match="No space left"):
        own.write(0, band(2))
    assert same(own.read(0, empty()), band(1))
    assert [path.name for path in own.folder.iterdir()] == ["band-000000.samples"]


def test_files_of_killed_writers_are_deleted(tmp_path):
    """Old ones; a clock that jumped back makes them look new, and they stay."""
    own = store(tmp_path)
    own.write(0, band())
    ages = {"0123abcd": -7200.0, "00000001": -5.0, "00000002": 1e6}
    for name, age in ages.items():
        path = own.folder / f".{name}-band-000000.samples"
        path.touch()
        os.utime(path, (time.time() + age,) * 2)
    found = {path.name for path in store(tmp_path).folder.iterdir()}
    assert found == {
        ".00000001-band-000000.samples", ".00000002-band-000000.samples", "band-000000.samples",
    }  # fmt: skip


# ---- what a picture depends on ------------------------------------------------------------------


def digest(scene):
    return render_digest(scene, scene.tables)


def test_digests_are_of_what_the_picture_depends_on(tmp_path, monkeypatch):
    text = (SCENES / "cornell_box.yaml").read_text()
    scene = rt.Scene.parse(text)
    assert digest(scene) == digest(rt.Scene.parse("# a comment\n" + text))
    film = scene.film
    others = [
        scene.changed(film=film.model_copy(update={"width": film.width + 1})),
        scene.changed(film=film.model_copy(update={"layers": ("variance",)})),
        scene.changed(sampler=rt.Sobol(spp=64, seed=99)),
        scene.changed(sampler=rt.Independent(spp=64)),
        scene.changed(integrator=rt.Path(max_depth=3)),
        scene.changed(camera=scene.camera.model_copy(update={"eye": (0.0, 1.0, 5.0)})),
        scene.changed(shapes=scene.shapes[:-1]),
        scene.changed(lights=(rt.Constant(radiance=(1e-9, 0, 0)),)),
    ]
    found = {digest(one) for one in (scene, *others)}
    assert len(found) == 1 + len(others)
    monkeypatch.setattr(checkpoint, "sources_digest", lambda: b"other sources")
    assert digest(scene) not in found


def test_samples_may_be_added_unless_they_depend_on_their_number():
    scene = rt.Scene.load(SCENES / "cornell_box.yaml")
    for sampler in (rt.Sobol(spp=4), rt.Independent(spp=4)):
        more = sampler.model_copy(update={"spp": 9})
        assert digest(scene.changed(sampler=sampler)) == digest(scene.changed(sampler=more))
    whitted = rt.Scene.load(SCENES / "spheres_whitted.yaml")
    grids = [whitted.changed(sampler=rt.Grid(spp=n)) for n in (4, 9)]
    assert digest(grids[0]) != digest(grids[1])


def test_digests_are_of_files_not_of_names(tmp_path):
    image = np.full((4, 4, 3), 0.5)
    np.save(tmp_path / "a.npy", image)
    np.save(tmp_path / "b.npy", image)
    scene = """
textures: {t: {type: bitmap, file: NAME, encoding: raw}}
materials: {m: {type: diffuse, reflectance: t}}
shapes: [{type: sphere, material: m}]
"""
    named = [rt.Scene.parse(scene.replace("NAME", n), folder=tmp_path) for n in ("a.npy", "b.npy")]
    assert digest(named[0]) == digest(named[1])
    image[0, 0, 0] = np.nextafter(0.5, 1.0)
    np.save(tmp_path / "a.npy", image)
    assert digest(rt.Scene.parse(named[0].to_yaml(), folder=tmp_path)) != digest(named[1])
