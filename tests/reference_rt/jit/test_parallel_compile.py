"""Kernels compiled in several processes, some of which fail."""

import os
import signal
import time
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from reference_rt.jit import parallel_compile
from reference_rt.jit.kernel import entry_kernel, is_compiled, precompile, signature_of
from reference_rt.jit.parallel_compile import Ahead

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")


@entry_kernel
def increase(x: Any, by: float) -> None:
    x[0] += by


@entry_kernel
def decrease(x: Any, by: float) -> None:
    x[0] -= by


@entry_kernel
def scale(x: Any, by: float) -> None:
    x[0] *= by


KERNELS = increase, decrease, scale


class Cold(NamedTuple):
    """calls of which nothing is compiled;  here: this process's number;  children: those of its
    children;  log: a file in which every process writes what it compiles."""

    calls: list[parallel_compile.Call]
    here: int
    children: list[int]
    log: Path

    def note(self, compiled):
        """In whichever process compiles."""
        with self.log.open("a") as file:  # short lines are appended whole
            print(os.getpid(), compiled.__name__, file=file)

    def compiled(self, here):
        """What this process has compiled, or all others."""
        lines = [line.split() for line in self.log.read_text().splitlines()]
        return [name for pid, name in lines if (int(pid) == self.here) == here]

    def children_have_ended(self):
        """Asked by their numbers: other tests' children may live on in this process."""
        for child in self.children:
            with suppress(ChildProcessError):
                os.waitpid(child, os.WNOHANG)
                return False
        return True


@pytest.fixture
def cold(monkeypatch, tmp_path):
    calls = [(kernel, signature_of(np.zeros(1), 1.0)) for kernel in KERNELS]
    found = Cold(calls, os.getpid(), [], tmp_path / "log")
    found.log.touch()
    fork = parallel_compile.fork_with_compiler

    def forked():
        child = fork()
        if child:
            found.children.append(child)
        return child

    monkeypatch.setattr(parallel_compile, "fork_with_compiler", forked)
    monkeypatch.setattr(parallel_compile, "is_compiled", lambda *call: False)
    monkeypatch.setattr(parallel_compile, "may_fork", lambda: hasattr(os, "fork"))
    return found


forks = pytest.mark.skipif(not hasattr(os, "fork"), reason="one process")


@forks
@pytest.mark.parametrize("threads", [2, 3, 50])
def test_each_kernel_is_compiled_by_one_process(threads, cold, monkeypatch):
    """At most as many processes as kernels, each of which takes the next when it is free."""

    def slow(kernel, signature):
        cold.note(kernel)
        time.sleep(0.2)
        return kernel

    monkeypatch.setattr(parallel_compile, "precompile", slow)
    told = []
    done = parallel_compile.precompile_all(cold.calls, threads, lambda *now: told.append(now))
    assert done == [*KERNELS]
    assert len(cold.children) == min(threads, 3) - 1
    assert cold.children_have_ended()
    # Last, this process loads all of them: these are its last three lines.
    names = [kernel.__name__ for kernel in KERNELS]
    here = cold.compiled(True)
    assert here[-3:] == names
    assert sorted(here[:-3] + cold.compiled(False)) == sorted(names)
    assert len(cold.compiled(False)) >= len(cold.children)
    assert told[0] == (0, 3)
    assert told[-1] == (3, 3)
    assert told == sorted(told)


@pytest.mark.parametrize("threads", [1, 4])
def test_one_process_says_what_is_done_too(threads, cold, monkeypatch):
    monkeypatch.setattr(parallel_compile, "may_fork", lambda: False)
    told = []
    parallel_compile.precompile_all(cold.calls, threads, lambda *now: told.append(now))
    assert told == [(0, 3), (1, 3), (2, 3), (3, 3)]
    assert cold.children == []


def test_nothing_is_said_or_started_for_what_is_compiled(cold, monkeypatch):
    for call in cold.calls:
        precompile(*call)
    monkeypatch.setattr(parallel_compile, "is_compiled", is_compiled)
    told = []
    parallel_compile.precompile_all(cold.calls, 4, lambda *now: told.append(now))
    assert (told, cold.children) == ([], [])
    assert parallel_compile.precompile_all([], 4) == []


@forks
@pytest.mark.parametrize("ahead", [False, True])
@pytest.mark.parametrize("fault", ["stands still", "fails", "is killed"])
def test_what_comes_to_nothing_elsewhere_is_compiled_here(fault, ahead, cold, monkeypatch):
    def one_that_ends(kernel, signature):
        if os.getpid() == cold.here:
            while cold.compiled(False) == []:  # until the other process has taken one
                time.sleep(0.01)
            return precompile(kernel, signature)
        cold.note(kernel)
        if fault == "stands still":
            time.sleep(1000.0)
        if fault == "fails":
            raise OSError("no space left on device")
        return os.kill(os.getpid(), 9)

    monkeypatch.setattr(parallel_compile, "precompile", one_that_ends)
    monkeypatch.setattr(parallel_compile, "PATIENCE", 0.5)
    told = []
    with Ahead(cold.calls, 2) if ahead else nullcontext() as begun:
        done = parallel_compile.precompile_all(cold.calls, 2, lambda *now: told.append(now), begun)
    assert len(done) == 3
    assert len(cold.compiled(False)) == 1
    assert all(is_compiled(*call) for call in cold.calls)
    assert cold.children_have_ended()
    if not ahead:
        assert told == [(0, 3), (1, 3), (2, 3)]  # of that at which the child failed nothing is said


@forks
@pytest.mark.parametrize("when", ["compiling", "waiting", "saying"])
def test_an_interrupt_ends_the_other_processes_too(when, cold, monkeypatch):
    def interrupt(*arguments):
        raise KeyboardInterrupt

    def compiling(kernel, signature):
        if os.getpid() != cold.here:
            cold.note(kernel)
            time.sleep(1000.0)
        elif when == "compiling":
            interrupt()

    def saying(done, total):
        if when == "saying" and done > 0:
            interrupt()

    monkeypatch.setattr(parallel_compile, "precompile", compiling)
    if when == "waiting":
        monkeypatch.setattr(parallel_compile.time, "monotonic", interrupt)
    descriptors = len(list(Path("/dev/fd").iterdir()))
    with pytest.raises(KeyboardInterrupt):
        parallel_compile.precompile_all(cold.calls, 3, saying)
    assert len(cold.children) == 2
    assert cold.children_have_ended()
    assert len(list(Path("/dev/fd").iterdir())) == descriptors


@forks
def test_a_child_is_deaf_to_an_interrupt(cold, monkeypatch):
    """Ctrl-C in a terminal goes to it too; this process ends it."""

    def compiling(kernel, signature):
        if os.getpid() != cold.here:
            os.kill(os.getpid(), signal.SIGINT)
            cold.note(kernel)
        while cold.compiled(False) == []:
            time.sleep(0.01)

    monkeypatch.setattr(parallel_compile, "precompile", compiling)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        parallel_compile.precompile_all(cold.calls, 2)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert cold.compiled(False)


@forks
def test_an_error_here_ends_the_other_processes_too(cold, monkeypatch):
    def compiling(kernel, signature):
        if os.getpid() != cold.here:
            time.sleep(1000.0)
        raise TypeError("no such kernel")

    monkeypatch.setattr(parallel_compile, "precompile", compiling)
    with pytest.raises(TypeError, match="no such kernel"):
        parallel_compile.precompile_all(cold.calls, 2)
    assert cold.children_have_ended()


# ---- ahead --------------------------------------------------------------------------------------


@pytest.fixture
def noting(cold, monkeypatch):
    def one(kernel, signature):
        cold.note(kernel)
        return precompile(kernel, signature)

    monkeypatch.setattr(parallel_compile, "precompile", one)
    return cold


@forks
def test_what_is_begun_ahead_is_not_begun_again(noting):
    """This process compiles the rest meanwhile, and loads all in the end."""
    told = []
    with Ahead(noting.calls[:2], 2) as ahead:
        parallel_compile.precompile_all(noting.calls, 2, lambda *now: told.append(now), ahead)
    assert noting.compiled(False) == ["increase", "decrease"]
    assert noting.compiled(True) == ["scale", "increase", "decrease", "scale"]
    assert len(noting.children) == 1
    assert noting.children_have_ended()
    assert (told[0], told[-1]) == ((0, 3), (3, 3))


@forks
def test_an_error_ends_what_was_begun_ahead(cold, monkeypatch):
    monkeypatch.setattr(parallel_compile, "precompile", lambda *call: time.sleep(1000.0))
    with pytest.raises(OSError, match="the scene's mesh"), Ahead(cold.calls, 2):
        raise OSError("the scene's mesh")
    assert len(cold.children) == 1
    assert cold.children_have_ended()


def test_nothing_is_begun_ahead_by_one_thread_or_without_need(cold, monkeypatch):
    Ahead(cold.calls, 1)
    Ahead([], 2)
    monkeypatch.setattr(parallel_compile, "is_compiled", lambda *call: True)
    Ahead(cold.calls, 2)
    assert cold.children == []
