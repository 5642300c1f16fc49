"""Renders that end early and go on: the same bits as a render without a break."""

import multiprocessing
import os
import signal

import numpy as np
import pytest
from small_scenes import LAYERS, same, small

import reference_rt as rt
from reference_rt.core.exr import read_exr
from reference_rt.rendering.executor import Remote, compute_remotely, remote_scene
from reference_rt.rendering.framebuffer import Framebuffer
from reference_rt.rendering.loop import Limits, Snapshot
from reference_rt.rendering.render import Session, Storage
from reference_rt.rendering.units import BAND, Unit
from reference_rt.util.errors import UsageError, WorkersError


def silent(what, fraction):
    pass


def sized(scene, **changes):
    return scene.changed(film=scene.film.model_copy(update=changes))


@pytest.fixture(scope="module")
def box():
    return sized(small("cornell_box"), width=60, height=40).changed(sampler=rt.Sobol(spp=40))


@pytest.fixture(scope="module")
def whole(box):
    return rt.render(box)


class Ended(Exception):  # noqa: N818
    pass


def end_at(fraction):
    def say(what, done):
        if what == "render" and done >= fraction:
            raise Ended

    return say


@pytest.mark.parametrize("name", ["cornell_box", "spheres_whitted", "many_lights"])
def test_passes_change_no_bit(name):
    """A render that may end early computes the same as one that may not."""
    scene = small(name)
    scene = scene.changed(sampler=scene.resolved_sampler.model_copy(update={"spp": 49}))
    with Session(scene, threads=2, limits=Limits(seconds=1e9)) as session:
        session.run(silent)
        assert same(session.picture(), rt.render(scene))


def test_ended_and_resumed(box, whole, tmp_path):
    for fraction in (0.1, 0.4, 0.7):
        with pytest.raises(Ended):
            rt.render(box, checkpoint=tmp_path, progress=end_at(fraction))
    said = []
    picture = rt.render(box, checkpoint=tmp_path, progress=lambda *one: said.append(one))
    assert same(picture, whole)
    assert next(done for what, done in said if what == "render") >= 0.1
    # A finished one is not computed again.
    said.clear()
    assert same(rt.render(box, checkpoint=tmp_path, progress=lambda *one: said.append(one)), whole)
    assert {done for what, done in said if what == "render"} == {1.0}


def test_more_samples(box, whole, tmp_path):
    rt.render(box, spp=13, checkpoint=tmp_path)
    with Session(box, storage=Storage(tmp_path, more=27)) as session:
        session.run(silent)
        assert same(session.picture(), whole)
        assert session.scene.sampler.spp == 40
        session.save(tmp_path / "out.exr")
    whole.save(tmp_path / "whole.exr")
    assert (tmp_path / "out.exr").read_bytes() == (tmp_path / "whole.exr").read_bytes()


def test_more_samples_of_nothing(box, tmp_path):
    with pytest.raises(UsageError, match="has no samples of this scene"):
        Session(box, storage=Storage(tmp_path, more=1))
    with pytest.raises(UsageError, match="depend on their number"):
        Session(small("spheres_whitted"), storage=Storage(tmp_path, more=1))


def test_fewer_samples_than_there_are(box, tmp_path):
    rt.render(box, checkpoint=tmp_path)
    with pytest.raises(UsageError, match="40 samples per pixel already"):
        rt.render(box, spp=20, checkpoint=tmp_path)


def test_a_checkpoint_of_another_scene_is_not_used(box, whole, tmp_path):
    """One folder may have any number of renders."""
    rt.render(box, seed=99, checkpoint=tmp_path)
    rt.render(sized(box, layers=()), checkpoint=tmp_path)
    assert same(rt.render(box, checkpoint=tmp_path), whole)
    assert len(list(tmp_path.iterdir())) == 3


def test_damaged_files_are_computed_again(box, whole, tmp_path):
    rt.render(box, checkpoint=tmp_path)
    (file,) = tmp_path.rglob("*.samples")
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    assert same(rt.render(box, checkpoint=tmp_path), whole)


@pytest.mark.slow
def test_a_partial_picture_says_so(box, tmp_path):
    with Session(box.changed(sampler=rt.Sobol(spp=10**6)), limits=Limits(1e9)) as session:
        with pytest.raises(Ended):
            session.run(end_at(40e-6))  # passes of 16 samples
        session.save(tmp_path / "out.exr")
        taken = session.taken
        picture = session.picture()
    assert 16 <= taken.fewest <= taken.most < 10**6
    _, header = read_exr(tmp_path / "out.exr")
    assert header["partial"] == taken.partial
    assert str(10**6) in taken.partial
    assert picture.taken == taken
    # Each pixel is the mean of its own samples: those of a whole picture of so many.
    counts = np.unique(session.frame.samples())
    others = [rt.render(box, spp=int(n)).colour for n in counts]
    same_as_one = [(picture.colour == other).all(axis=-1) for other in others]
    assert np.logical_or.reduce(same_as_one).all()


# ---- memory -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_bands_on_disk_change_no_bit(tmp_path, monkeypatch):
    """Three bands of which two are in memory; all layers; written some rows at a time."""
    scene = sized(small("cornell_box"), width=600, height=600, layers=LAYERS)
    scene = scene.changed(sampler=rt.Sobol(spp=2), integrator=rt.Path(max_depth=2))
    monkeypatch.setattr(
        "reference_rt.rendering.render.check_fits",
        lambda scene, widths, memory, store: memory and 2 * BAND * 8 * 17,
    )
    with Session(scene, storage=Storage(tmp_path / "parts"), memory=1) as session:
        session.run(silent)
        assert session.frame.whole is None
        found = session.save(tmp_path / "parts.exr")
        with pytest.raises(UsageError, match="needs the whole picture in memory"):
            session.save(tmp_path / "parts.png")
    picture = rt.render(scene)
    assert found == (picture.nonfinite, (), False)
    picture.save(tmp_path / "whole.exr")
    parts, header = read_exr(tmp_path / "parts.exr")
    planes, expected = read_exr(tmp_path / "whole.exr")
    assert parts.keys() == planes.keys()
    assert all(parts[name].tobytes() == planes[name].tobytes() for name in planes)
    for name in ("sceneSha256", "sampler", "software"):
        assert header[name] == expected[name]


def test_too_little_memory_is_refused(box, tmp_path):
    large = sized(box, width=10000, height=10000)
    with pytest.raises(UsageError, match="MiB already; expected at least"):
        Session(large, storage=Storage(tmp_path), memory=1 << 20)


# ---- processes ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_processes_change_no_bit(box, whole):
    assert same(rt.render(box, workers=2), whole)


@pytest.mark.slow
def test_killed_processes_are_replaced(box, monkeypatch):
    """One is killed whenever something was computed since the last one died, twice."""
    monkeypatch.setattr(Remote, "size", 1 << 14)
    killed, last = [], 0.0

    def kill(what, fraction):
        nonlocal last
        children = multiprocessing.active_children()
        if what == "render" and fraction > last and children and len(killed) < 2:
            os.kill(children[0].pid, signal.SIGKILL)
            killed.append(children[0].pid)
            last = fraction

    scene = box.changed(sampler=rt.Sobol(spp=200))
    found = rt.render(scene, workers=2, progress=kill)
    assert same(found, rt.render(scene))
    assert len(set(killed)) == 2


def test_workers_with_other_files_refuse(tmp_path, box):
    other = remote_scene(box, b"x" * 32, 64)
    with pytest.raises(WorkersError, match="has other tables of the scene"):
        compute_remotely(other, Unit(0, 64, 0, 1), None)
    with pytest.raises(WorkersError, match="has another version"):
        compute_remotely(other._replace(sources=b"y" * 32), Unit(0, 64, 0, 1), None)


def test_a_framebuffer_has_what_its_samples_say():
    frame = Framebuffer({"colour": 3}, 100)
    assert frame.samples().tolist() == [0] * 100


def test_a_preview_is_of_the_samples_of_its_moment(box):
    """The render goes on between a snapshot and the picture that is made of it."""
    with Session(box, threads=1) as session:
        session.run(silent)
        sums = {name: array / 2.0 for name, array in session.frame.whole.items()}
        session.loop._snapshot = Snapshot(sums, session.frame.samples() // 2)
        preview = session.preview()
        assert (preview.taken.fewest, preview.taken.most, preview.taken.wanted) == (20, 20, 40)
        assert np.array_equal(preview.colour, session.picture().colour)
