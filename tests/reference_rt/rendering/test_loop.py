"""The loop of a render: the same sums whatever executors do, limits, and checkpoints."""

import threading
import time

import numpy as np
import pytest
from fake_executors import Fake, expected, sample

from reference_rt.rendering.checkpoint import Checkpoint
from reference_rt.rendering.framebuffer import Framebuffer
from reference_rt.rendering.loop import Limits, Loop, Saving
from reference_rt.rendering.units import BAND, passes
from reference_rt.util.errors import ImageError

WIDTHS = {"colour": 3}


def nothing():
    pass


def rendered(pixels, spp, frame=None, **how):
    """The frame after a render by a `Fake`, its loop and the executor."""
    frame = frame or Framebuffer(WIDTHS, pixels)
    executor = Fake(pixels, **how)
    loop = Loop(frame, executor, spp)
    try:
        loop.run(nothing)
    finally:
        executor.close()
    return frame, loop, executor


@pytest.mark.parametrize("size", [1, 300, 4096, 1 << 20])
@pytest.mark.parametrize("slots", [1, 2, 40])
def test_same_bits_for_any_units(size, slots):
    frame, loop, _ = rendered(1000, 70, size=size, slots=slots, late=0.001)
    assert np.array_equal(frame.whole["colour"], expected(1000, 70))
    assert (frame.done == 70).all()
    assert loop.fraction == 1.0


@pytest.mark.parametrize("seed", range(8))
def test_lost_units_are_computed_again(seed):
    """Neither lost nor added twice."""
    frame, _, executor = rendered(1500, 100, late=0.002, lost=0.4, seed=seed, slots=10)
    assert np.array_equal(frame.whole["colour"], expected(1500, 100))
    assert len(executor.units) > len(set(executor.units)) > 20


def test_more_samples_later():
    frame, *_ = rendered(700, 37)
    frame, loop, _ = rendered(700, 90, frame)
    assert loop.had == 37 / 90
    assert np.array_equal(frame.whole["colour"], expected(700, 90))


def test_a_unit_that_fails_for_good_ends_the_render():
    before = threading.active_count()
    with pytest.raises(ZeroDivisionError):
        rendered(1000, 1000, broken=7)
    assert threading.active_count() == before


def test_an_interrupt_gives_up_and_keeps_what_is_done():
    pixels, frame = 5000, Framebuffer(WIDTHS, 5000)
    executor = Fake(pixels, late=0.01)
    loop, calls = Loop(frame, executor, 10**6), []

    def watch():
        calls.append(loop.fraction)
        if len(calls) == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        loop.run(watch)
    executor.close()
    assert calls == sorted(calls)
    assert frame.done.max() < 10**6
    # Each pixel has the sum of so many samples as it says.
    for spp in np.unique(frame.done):
        mine = frame.samples() == spp
        assert np.array_equal(frame.whole["colour"][mine], expected(pixels, int(spp))[mine])


def test_a_time_limit():
    frame = Framebuffer(WIDTHS, 5000)
    executor = Fake(5000, late=0.005)
    loop = Loop(frame, executor, 10**6, Limits(seconds=0.3))
    began = time.monotonic()
    loop.run(nothing)
    executor.close()
    assert loop.stopped == "time"
    assert time.monotonic() - began >= 0.3
    # No sample is lost of the units that had begun.
    taken = sum(unit.samples for unit in executor.units)
    assert frame.samples().sum() == taken < 5000 * 10**6


def test_a_target_error_stops_at_the_same_samples():
    """After a pass, whatever computes it."""
    stops, errors = set(), set()
    for how in ({}, {"size": 100, "slots": 3}, {"late": 0.003, "lost": 0.2}):
        frame = Framebuffer(WIDTHS, 1000)
        executor = Fake(1000, **how)
        loop = Loop(frame, executor, 5000, Limits(error=0.05))
        loop.run(nothing)
        executor.close()
        assert loop.stopped == "error"
        stops |= set(frame.done.tolist())
        errors.add(loop.error)
    (spp,), (error,) = stops, errors
    assert spp in passes(5000, 64)
    values = np.array([sample(np.arange(1000), k) for k in range(spp)])
    true = np.sqrt(values.var(axis=0, ddof=1).mean() / spp) / values.mean()
    # 3000 pixels and channels, each by a few passes: see `test_noise`.
    assert error == pytest.approx(true, rel=0.1)
    assert true < 0.055


def test_a_target_that_is_not_reached():
    frame = Framebuffer(WIDTHS, 500)
    executor = Fake(500)
    loop = Loop(frame, executor, 64, Limits(error=1e-4))
    loop.run(nothing)
    executor.close()
    assert (loop.stopped, frame.done.min()) == ("", 64)
    assert loop.error > 1e-4


def test_snapshots_are_whole():
    frame = Framebuffer(WIDTHS, 2000)
    executor = Fake(2000, late=0.002)
    loop, found = Loop(frame, executor, 400), []

    def watch():
        if (one := loop.snapshot()) is not None:
            found.append(one)

    loop.run(watch)
    executor.close()
    assert found
    for snapshot in found:
        for spp in np.unique(snapshot.samples):
            mine = snapshot.samples == spp
            assert np.array_equal(snapshot.sums["colour"][mine], expected(2000, int(spp))[mine])


# ---- checkpoints --------------------------------------------------------------------------------


def stored(folder, digest=b"d" * 32, resume=True):
    return Checkpoint(folder, lambda: digest, resume)


@pytest.mark.parametrize("budget", [None, 2 * BAND * 24])
def test_interrupted_often_ends_with_the_same_bits(budget, tmp_path):
    """Whether all bands are in memory or two of four; each run is ended at another moment."""
    pixels, spp = 3 * BAND + 999, 4
    runs = 0
    while True:
        frame = Framebuffer(WIDTHS, pixels, stored(tmp_path), budget)
        executor = Fake(pixels, size=1 << 16, slots=4, late=0.001, seed=runs)
        saving = Saving(0.0, every=0.0, needed=budget is not None)
        loop, ends = Loop(frame, executor, spp, saving=saving), runs % 5

        def watch(ends=ends, calls=[]):  # noqa: B006
            calls.append(1)
            if len(calls) > ends:
                raise KeyboardInterrupt

        try:
            loop.run(watch if runs < 7 else nothing)
        except KeyboardInterrupt:
            runs += 1
            continue
        finally:
            executor.close()
            frame.close()
        break
    parts = [sums["colour"] for _, sums, _ in frame.slices(1000)]
    assert np.array_equal(np.concatenate(parts), expected(pixels, spp))


def test_another_run_on_the_same_checkpoint(tmp_path):
    """Both store what they have; each ends with the right sums, and so does a third run."""
    pixels, spp = BAND + 5000, 6
    frames, threads = [], []
    for seed in range(2):
        frame = Framebuffer(WIDTHS, pixels, stored(tmp_path), 2 * BAND * 24 * (seed + 1))
        executor = Fake(pixels, size=1 << 15, late=0.01 * (seed + 1), seed=seed)
        loop = Loop(frame, executor, spp, saving=Saving(0.0, 0.0))
        frames.append(frame)
        threads.append(threading.Thread(target=loop.run, args=(nothing,)))
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    frames.append(Framebuffer(WIDTHS, pixels, stored(tmp_path)))
    for frame in frames:
        assert (frame.done == spp).all()
        found = np.concatenate([sums["colour"] for _, sums, _ in frame.slices(4096)])
        assert np.array_equal(found, expected(pixels, spp))


@pytest.mark.parametrize("needed", [False, True])
def test_a_full_disk(needed, tmp_path):
    """A render in memory goes on, and says so; one that needs the disk ends with a clear error."""
    pixels = BAND + 100
    store = stored(tmp_path)
    writes = []

    def full(k, band):
        writes.append(k)
        raise ImageError(f"{store.path(k)}: cannot be written: No space left on device")

    store.write = full
    frame = Framebuffer(WIDTHS, pixels, store)
    executor = Fake(pixels, size=1 << 16)
    loop = Loop(frame, executor, 3, saving=Saving(0.0, 0.0, needed))
    if needed:
        with pytest.raises(ImageError, match="No space left"):
            loop.run(nothing)
    else:
        loop.run(nothing)
        assert "No space left" in loop.save_error
        assert np.array_equal(frame.whole["colour"], expected(pixels, 3))
    executor.close()
    assert writes


def test_a_disk_that_is_full_for_a_while(tmp_path, monkeypatch):
    monkeypatch.setattr("reference_rt.rendering.loop._AGAIN", 0.0)
    pixels, store = 3000, stored(tmp_path)
    write, failed = store.write, []

    def full_at_first(k, band):
        if len(failed) < 3:
            failed.append(k)
            raise ImageError("full")
        write(k, band)

    store.write = full_at_first
    frame = Framebuffer(WIDTHS, pixels, store)
    executor = Fake(pixels, late=0.01)
    loop = Loop(frame, executor, 100, saving=Saving(0.0, 0.0))
    loop.run(nothing)
    executor.close()
    assert len(failed) == 3
    assert loop.save_error == ""
    again = Framebuffer(WIDTHS, pixels, stored(tmp_path))
    assert np.array_equal(again.whole["colour"], expected(pixels, 100))
