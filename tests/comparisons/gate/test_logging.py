"""What the packages log: nothing is printed by default."""

import logging
import subprocess
import sys

import numpy as np
import pytest

import comparisons
from reference_rt import Film, Point, Scene, Sphere, Whitted, render

GATE = """
import numpy as np
import comparisons
picture = np.ones((4, 4, 3))
comparisons.gate(picture, reference=picture, noise_free=True)
"""


def test_renders_and_verdicts_are_logged(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    lit = {
        "shapes": (Sphere(center=(0, 0, -3)),),
        "lights": (Point(position=(0, 2, 0), intensity=(1, 1, 1)),),
    }
    render(Scene(film=Film(width=4, height=3), integrator=Whitted(), **lit), spp=4)
    picture = np.ones((4, 4, 3))
    comparisons.gate(picture, reference=picture, noise_free=True)
    told = {record.name: record.getMessage() for record in caplog.records}
    assert told["reference_rt.rendering.render"].startswith("scene: 4 x 3 pixels, 4 samples each; ")
    assert told["comparisons.gate.request"].partition(": ")[2].startswith("unchanged: ")


def test_nothing_is_printed_by_default() -> None:
    words = [sys.executable, "-c", GATE]
    found = subprocess.run(words, capture_output=True, text=True, check=True, timeout=300)
    assert found.stdout == found.stderr == ""
