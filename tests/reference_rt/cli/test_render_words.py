"""What a render says at its end, and what becomes of a preview that cannot be written."""

from types import SimpleNamespace

import pytest

from reference_rt.cli import render
from reference_rt.rendering.loop import Limits
from reference_rt.util.errors import ImageError


@pytest.mark.parametrize(
    ("error", "wanted", "said"),
    [
        (0.03, 0.01, "; relative error 3 %, not 1 %: that takes about 9.0 times the samples"),
        (0.01, 0.02, "; relative error 1 %"),
    ],
)
def test_the_samples_that_an_error_takes(error, wanted, said):
    """The error falls with their root."""
    taken = SimpleNamespace(error=error, partial="", most=64)
    session = SimpleNamespace(taken=taken, loop=SimpleNamespace(stopped=""))
    assert render._reached(session, Limits(error=wanted)) == said


def test_a_preview_that_cannot_be_written_ends_no_render(tmp_path):
    saved = []

    def save(path):
        saved.append(path)
        raise ImageError("no space left")

    picture = SimpleNamespace(taken=SimpleNamespace(fewest=1), save=save)
    session = SimpleNamespace(
        preview=lambda: picture, loop=SimpleNamespace(error=None, fraction=0.5)
    )
    progress = SimpleNamespace(note=lambda text: None, is_terminal=True, draws=False)
    watch = render.Watch(session, progress, tmp_path / "a.png")
    watch()
    watch()
    assert saved == [tmp_path / "a.png"]
