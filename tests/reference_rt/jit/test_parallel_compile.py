"""Kernels compiled in several processes, and kernels called through function pointers."""

import os
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from reference_rt import Scene, Sphere
from reference_rt.jit import parallel_compile
from reference_rt.jit.function_pointer import call_pointer, pointer_to
from reference_rt.jit.kernel import entry_kernel, is_compiled, precompile, signature_of
from reference_rt.rendering import kernels
from reference_rt.rendering import render as rendering

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")

_TWO = """
import os
import time
from pathlib import Path
import numpy as np
from reference_rt.jit import parallel_compile
from reference_rt.jit.kernel import entry_kernel, is_compiled, signature_of

@entry_kernel
def double(x):
    x[0] *= 2.0

@entry_kernel
def negate(x):
    x[0] = -x[0]

here, taken, precompile = os.getpid(), Path("taken"), parallel_compile.precompile

def one_for_the_child(kernel, signature):
    if os.getpid() != here:
        taken.touch()
    while not taken.exists():
        time.sleep(0.01)
    return precompile(kernel, signature)

def main():
    parallel_compile.precompile = one_for_the_child
    x = np.array([3.0])
    calls = [(kernel, signature_of(x)) for kernel in (double, negate)]
    before = [is_compiled(*call) for call in calls]
    parallel_compile.precompile_all(calls, threads=2)
    double(x)
    negate(x)
    hits = sum(sum(k.stats.cache_hits.values()) for k in (double, negate))
    print(before, "some" if hits > 0 else "none", x)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is one process")
def test_what_others_compile_is_found_in_the_cache(tmp_path):
    """By this process; the next one finds all."""
    (tmp_path / "two.py").write_text(_TWO)
    for before in (False, True):
        done = subprocess.run(
            [sys.executable, "-c", "import two; two.main()"],
            env=os.environ | {"REFERENCE_RT_CACHE": str(tmp_path / "cache")},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.strip() == f"{[before] * 2} some [-6.]"


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
@pytest.mark.parametrize("fault", ["stands still", "fails", "is killed"])
def test_what_comes_to_nothing_elsewhere_is_compiled_here(fault, cold, monkeypatch):
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
    parallel_compile.precompile_all(cold.calls, 2, lambda *now: told.append(now))
    assert len(cold.compiled(False)) == 1
    assert all(is_compiled(*call) for call in cold.calls)
    assert cold.children_have_ended()
    assert told == [(0, 3), (1, 3), (2, 3)]  # never more than there are


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
def test_an_error_here_ends_the_other_processes_too(cold, monkeypatch):
    def compiling(kernel, signature):
        if os.getpid() != cold.here:
            time.sleep(1000.0)
        raise TypeError("no such kernel")

    monkeypatch.setattr(parallel_compile, "precompile", compiling)
    with pytest.raises(TypeError, match="no such kernel"):
        parallel_compile.precompile_all(cold.calls, 2)
    assert cold.children_have_ended()


class Pair(NamedTuple):
    numbers: Any
    factor: float


@entry_kernel
def weigh(pair: Pair, nothing: None, offset: int, negative: bool, out: Any) -> None:
    for i in range(len(out)):
        value = pair.numbers[i] * pair.factor + offset
        out[i] = -value if negative else value


@entry_kernel
def weigh_at(address: Any, pair: Pair, out: Any) -> None:
    call_pointer(address[0], (pair, None, len(out), True, out))


def test_a_kernel_is_called_at_its_address():
    pair, out = Pair(np.array([1.0, 2.0, 4.0]), 0.5), np.zeros(3)
    signature = signature_of(pair, None, 0, False, out)
    precompile(weigh, signature)
    weigh_at(np.array([pointer_to(weigh, signature)], np.intp), pair, out)
    assert out.tolist() == [-3.5, -4.0, -5.0]


def test_paths_are_the_same_with_their_tracer_apart(monkeypatch):
    """Enough spheres for a hierarchy, one in the other's light."""
    rng = np.random.default_rng(7)
    spheres = tuple(Sphere(center=tuple(rng.uniform(-2.0, 2.0, 3)), radius=0.4) for _ in range(60))
    scene = Scene.model_validate(
        {
            "shapes": [s.model_dump() for s in spheres],
            "camera": {"type": "perspective", "eye": [0.5, 1.0, 5.0]},
            "lights": [{"type": "constant", "radiance": 1.0}],
            "film": {"width": 16, "height": 16},
            "sampler": {"type": "sobol", "spp": 4},
            "integrator": {"type": "path", "max_depth": 3},
        }
    )
    asked = []
    tracer_of = kernels.tracer_of
    monkeypatch.setattr(kernels, "tracer_of", lambda g: asked.append(tracer_of(g)) or asked[-1])
    apart = rendering.render(scene, specialised=True)
    assert asked[0] is not None
    monkeypatch.setattr(kernels, "tracer_of", lambda geometry: None)
    assert np.array_equal(apart.colour, rendering.render(scene, specialised=True).colour)
    assert len(np.unique(apart.colour)) > 100
