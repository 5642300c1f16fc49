"""Kernels compiled in two processes, and kernels called through function pointers."""

import os
import subprocess
import sys
import time
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from reference_rt import Scene, Sphere, render
from reference_rt.jit import parallel_compile
from reference_rt.jit.function_pointer import call_pointer, pointer_to
from reference_rt.jit.kernel import entry_kernel, is_compiled, precompile, signature_of

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")

_TWO = """
import numpy as np
from reference_rt.jit.kernel import entry_kernel, is_compiled, signature_of
from reference_rt.jit.parallel_compile import precompile_all

@entry_kernel
def double(x):
    x[0] *= 2.0

@entry_kernel
def negate(x):
    x[0] = -x[0]

def main():
    x = np.array([3.0])
    calls = [(kernel, signature_of(x)) for kernel in (double, negate)]
    before = tuple(is_compiled(*call) for call in calls)
    precompile_all(calls, threads=2)
    double(x)
    negate(x)
    kernels = double, negate
    print(before, [sum(k.stats.cache_hits.values()) for k in kernels], x)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is one process")
def test_the_second_kernel_is_found_in_the_cache(tmp_path):
    """Compiled by another process, that is; the next process finds both."""
    (tmp_path / "two.py").write_text(_TWO)
    expected = "(False, False) [0, 1] [-6.]", "(True, True) [1, 1] [-6.]"
    for line in expected:
        done = subprocess.run(
            [sys.executable, "-c", "import two; two.main()"],
            env=os.environ | {"REFERENCE_RT_CACHE": str(tmp_path / "cache")},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.strip() == line


@entry_kernel
def increase(x: Any, by: float) -> None:
    x[0] += by


@entry_kernel
def decrease(x: Any, by: float) -> None:
    x[0] -= by


class Cold(NamedTuple):
    calls: list[parallel_compile.Call]
    here: int
    children: list[int]

    def one_child_has_ended(self):
        """Asked by its number: other tests' children may live on in this process."""
        (child,) = self.children
        try:
            os.waitpid(child, os.WNOHANG)
        except ChildProcessError:
            return True
        return False


@pytest.fixture
def cold(monkeypatch):
    """Two calls of which nothing is compiled, this process's number, and its children's."""
    calls = [(kernel, signature_of(np.zeros(1), 1.0)) for kernel in (increase, decrease)]
    children = []
    fork = parallel_compile._fork
    monkeypatch.setattr(
        parallel_compile, "_fork", lambda c: children.append(fork(c)) or children[-1]
    )
    monkeypatch.setattr(parallel_compile, "is_compiled", lambda *call: False)
    monkeypatch.setattr(parallel_compile, "may_fork", lambda: hasattr(os, "fork"))
    return Cold(calls, os.getpid(), children)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="one process")
@pytest.mark.parametrize("fault", ["stands still", "fails", "is killed"])
def test_what_comes_to_nothing_elsewhere_is_compiled_here(fault, cold, monkeypatch, tmp_path):
    compiled = []

    def one_that_ends(kernel, signature):
        if os.getpid() == cold.here:
            compiled.append(kernel)
            return precompile(kernel, signature)
        (tmp_path / "began").touch()  # in the other process
        if fault == "stands still":
            time.sleep(1000.0)
        if fault == "fails":
            raise OSError("no space left on device")
        return os.kill(os.getpid(), 9)

    monkeypatch.setattr(parallel_compile, "precompile", one_that_ends)
    monkeypatch.setattr(parallel_compile, "PATIENCE", 2.0)
    parallel_compile.precompile_all(cold.calls, threads=2)
    assert (tmp_path / "began").exists()
    assert compiled == [increase, increase, decrease]
    assert all(is_compiled(*call) for call in cold.calls)
    assert cold.one_child_has_ended()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="one process")
@pytest.mark.parametrize("when", ["compiling", "waiting"])
def test_an_interrupt_ends_the_other_process_too(when, cold, monkeypatch):
    def interrupt():
        raise KeyboardInterrupt

    def compiling(kernel, signature):
        if os.getpid() != cold.here:
            time.sleep(1000.0)
        elif when == "compiling":
            interrupt()

    monkeypatch.setattr(parallel_compile, "precompile", compiling)
    if when == "waiting":
        monkeypatch.setattr(parallel_compile.time, "monotonic", interrupt)
    with pytest.raises(KeyboardInterrupt):
        parallel_compile.precompile_all(cold.calls, threads=2)
    assert cold.one_child_has_ended()


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
    module = sys.modules["reference_rt.rendering.render"]
    asked = []
    tracer_of = module.tracer_of
    monkeypatch.setattr(module, "tracer_of", lambda g: asked.append(tracer_of(g)) or asked[-1])
    apart = render(scene)
    assert asked[0] is not None
    monkeypatch.setattr(module, "tracer_of", lambda geometry: None)
    assert np.array_equal(apart.colour, render(scene).colour)
    assert len(np.unique(apart.colour)) > 100
