"""Kernels called through function pointers."""

from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from reference_rt.jit.function_pointer import call_pointer, pointer_to

from reference_rt import Scene, Sphere
from reference_rt.jit.kernel import entry_kernel, precompile, signature_of
from reference_rt.rendering import kernels
from reference_rt.rendering import render as rendering

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")


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


@pytest.mark.slow
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
