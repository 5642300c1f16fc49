"""Plugins whose data are made at their first use: Mitsuba's scalar variants render in several
threads, of which one may be stopped at any line while another one goes on."""

import sys
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

import pytest

from comparisons.mitsuba.backend import mitsuba, scalar
from comparisons.mitsuba.plugins.base import PlainScene

LAMP = {"type": "mesh_area", "radiance": {"type": "rgb", "value": 1.0}}
SCENE = {"type": "scene", "lamp": {"type": "cube", "emitter": LAMP}}


@pytest.fixture(autouse=True)
def scalar_variant() -> Iterator[None]:
    """In the others Dr.Jit compiles code for all emitters that exist: one that a stopped thread's
    frames keep, whose mesh is gone, would end a later test's process."""
    with scalar():
        yield


class _StoppedError(Exception):
    pass


def at_line(number: int, then: Callable[[], None], run: Callable[[], None]) -> int:
    """Run with `then` called before the line of `prepare` that comes as `number`; how many lines
    there were."""
    seen = 0

    def line(frame: FrameType, event: str, arg: Any) -> Any:
        nonlocal seen
        if event == "line":
            if seen == number:
                then()
            seen += 1
        return line

    def called(frame: FrameType, event: str, arg: Any) -> Any:
        return line if frame.f_code.co_name == "prepare" else None

    before = sys.gettrace()
    sys.settrace(called)
    try:
        run()
    except _StoppedError:
        pass
    finally:
        sys.settrace(before)
    return seen


def stop() -> None:
    raise _StoppedError


def lamp() -> tuple[Callable[[], None], Callable[[], Any]]:
    scene = mitsuba().load_dict(SCENE)  # has the shape, which the emitter only refers to
    plugin = scene.emitters()[0]

    def value() -> Any:
        assert scene is not None
        return sorted(plugin.arrays), plugin.area, plugin.flips

    return plugin.prepare, value


def trees() -> tuple[Callable[[], None], Callable[[], Any]]:
    scene = PlainScene(mitsuba(), mitsuba().load_dict(SCENE))
    plugin = mitsuba().load_dict({"type": "whitted"})
    return lambda: plugin.prepare(scene), lambda: (len(plugin.lights), plugin.reach)


@pytest.mark.parametrize("made", [lamp, trees])
def test_one_thread_stopped_while_another_goes_on(
    made: Callable[[], tuple[Callable[[], None], Callable[[], Any]]],
) -> None:
    prepare, value = made()
    lines = at_line(-1, stop, prepare)
    assert lines > 5
    right = value()
    for first in range(-1, lines):  # -1: after the other one was stopped
        for second in range(lines):
            one, value = made()

            def other(one: Callable[[], None] = one, second: int = second) -> None:
                thread = threading.Thread(target=at_line, args=(second, stop, one))
                thread.start()
                thread.join()

            if first < 0:
                other()
                one()
            else:
                at_line(first, other, one)
            assert value() == right, (first, second)
