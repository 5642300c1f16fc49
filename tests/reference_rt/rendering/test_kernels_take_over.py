"""Specialised kernels that take over from linked ones: the same bits, and no child is left."""

import os
import signal
import sys
import time
from typing import Any

import numba
import pytest
from small_scenes import same, small

from reference_rt.jit import parallel_compile
from reference_rt.jit.parallel_compile import has_ended
from reference_rt.rendering import kernels
from reference_rt.rendering.render import render

forks = pytest.mark.skipif(
    numba.config.DISABLE_JIT or not hasattr(os, "fork"), reason="there is no second process"
)


class Watched:
    """A render whose tiles, from the second on, wait until `ready(running)`.

    children: the processes that were started;  linked: the kernels at first;  used: those that were
    called, as often as they were.
    """

    def __init__(self, monkeypatch, ready):
        self.children: list[int] = []
        self.used: list[Any] = []
        self.running: Any = None
        self.linked: Any = None
        run, fork = kernels.Running.run, kernels.fork_with_compiler

        def watched_run(running, k):
            self.running, inner, calls = running, run(running, k), []
            self.linked = self.linked or running.kernels

            def tile(*pixels):
                calls.append(pixels)
                end = time.monotonic() + 300.0
                while len(calls) > 1 and not ready(self) and time.monotonic() < end:
                    time.sleep(0.01)
                self.used.append(running.kernels[k])
                inner(*pixels)

            return tile

        def watched_fork():
            child = fork()
            if child:
                self.children.append(child)
            return child

        rendering = sys.modules["reference_rt.rendering.units"]
        monkeypatch.setattr(kernels.Running, "run", watched_run)
        monkeypatch.setattr(kernels, "fork_with_compiler", watched_fork)
        monkeypatch.setattr(parallel_compile, "may_fork", lambda: True)
        monkeypatch.setattr(kernels, "WAIT", 0.0)
        monkeypatch.setattr(kernels, "WORTHWHILE", 0.0)
        monkeypatch.setattr(rendering, "SAMPLES_PER_TILE", 256)


def as_if_not_compiled(monkeypatch, often=1):
    """As if the specialised kernels were not in the cache, the first `often` times that is asked
    for."""
    asked, compiled = [], kernels.Specialised.are_compiled

    def are_compiled(specialised):
        asked.append(specialised)
        return len(asked) > often and compiled(specialised)

    monkeypatch.setattr(kernels.Specialised, "are_compiled", are_compiled)


def slow_children(monkeypatch):
    here, precompile = os.getpid(), kernels.precompile

    def compiling(*call):
        if os.getpid() != here:
            time.sleep(1000.0)
        return precompile(*call)

    monkeypatch.setattr(kernels, "precompile", compiling)


@pytest.fixture
def scene():
    return small("cornell_box")


@pytest.mark.slow
@forks
def test_specialised_kernels_take_over_between_tiles(scene, monkeypatch):
    expected = render(scene, specialised=False)
    as_if_not_compiled(monkeypatch)
    watched = Watched(monkeypatch, lambda w: w.running.kernels is not w.linked)
    assert same(render(scene, threads=2), expected)
    assert len(watched.children) == 1
    linked, specialised = watched.linked, watched.running.kernels
    assert watched.used[0] is linked[0]
    assert all(kernel in watched.used for kernel in specialised)
    assert has_ended(watched.children[0])


@forks
def test_linked_kernels_stay_if_they_are_asked_for(scene, monkeypatch):
    watched = Watched(monkeypatch, lambda w: True)
    render(scene, threads=2, specialised=False)
    assert watched.children == []
    assert all(kernel in watched.linked for kernel in watched.used)


@pytest.mark.slow
@forks
def test_a_child_that_stores_nothing_changes_nothing(scene, monkeypatch):
    """On a full disk, for example."""
    expected = render(scene, specialised=False)
    as_if_not_compiled(monkeypatch, often=1000)
    watched = Watched(monkeypatch, lambda w: not w.running._may_change)
    assert same(render(scene, threads=2), expected)
    assert len(watched.children) == 1
    assert all(kernel in watched.linked for kernel in watched.used)


@forks
@pytest.mark.parametrize("end", ["finished", "error", "Ctrl-C"])
def test_no_child_is_left(end, scene, monkeypatch):
    as_if_not_compiled(monkeypatch)
    slow_children(monkeypatch)
    watched = Watched(monkeypatch, lambda w: w.children)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)

    def say(what, fraction):
        if watched.children and end == "error":
            raise RuntimeError("the terminal is gone")
        if watched.children and end == "Ctrl-C":
            signal.raise_signal(signal.SIGINT)

    try:
        if end == "finished":
            render(scene, threads=2, progress=say)
        else:
            with pytest.raises(RuntimeError if end == "error" else KeyboardInterrupt):
                render(scene, threads=2, progress=say)
    finally:
        signal.signal(signal.SIGINT, handler)
    assert len(watched.children) == 1
    assert has_ended(watched.children[0])


@forks
def test_a_short_render_starts_no_child(scene, monkeypatch):
    as_if_not_compiled(monkeypatch)
    watched = Watched(monkeypatch, lambda w: True)
    monkeypatch.setattr(kernels, "WORTHWHILE", 1e9)
    render(scene, threads=2)
    assert watched.children == []
