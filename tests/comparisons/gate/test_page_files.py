"""What a page reads lies in its folder, whatever links there are."""

import os
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from comparisons.gate import page_files
from comparisons.gate.page_files import read_below


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The page's, beside a file that it must not read."""
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "secret").write_text("secret")
    (tmp_path / "inside" / "sub").mkdir(parents=True)
    (tmp_path / "inside" / "sub" / "own").write_text("own")
    return tmp_path.resolve() / "inside"


INSIDE: dict[str, Callable[[Path], object]] = {
    "sub/own": lambda here: None,
    "/sub/own": lambda here: None,
    "sub/../sub/own": lambda here: None,
    "link": lambda here: (here / "link").symlink_to("sub/own"),
    "folder/own": lambda here: (here / "folder").symlink_to("sub"),
    "absolute": lambda here: (here / "absolute").symlink_to(here / "sub/own"),
    "around": lambda here: (here / "around").symlink_to("../inside/sub/own"),
    "second": lambda here: [
        (here / "first").symlink_to("sub/own"),
        (here / "second").symlink_to("first"),
    ],
}

OUTSIDE: dict[str, Callable[[Path], object]] = {
    "../outside/secret": lambda here: None,
    "sub/../../outside/secret": lambda here: None,
    "link": lambda here: (here / "link").symlink_to("../outside/secret"),
    "absolute": lambda here: (here / "absolute").symlink_to(here.parent / "outside/secret"),
    "folder/secret": lambda here: (here / "folder").symlink_to("../outside"),
    "folder/outside/secret": lambda here: (here / "folder").symlink_to("../outside/.."),
    "sub/up/outside/secret": lambda here: (here / "sub/up").symlink_to("../.."),
    "second": lambda here: [
        (here / "first").symlink_to("../outside/secret"),
        (here / "second").symlink_to("first"),
    ],
    "../inside2/secret": lambda here: [
        (here.parent / "inside2").mkdir(),
        (here.parent / "inside2/secret").write_text("secret"),
    ],
}

NO_FILE: dict[str, Callable[[Path], object]] = {
    "missing": lambda here: None,
    "sub": lambda here: None,
    "": lambda here: None,
    "sub/own/more": lambda here: None,
    "a\0b": lambda here: None,
    "x" * 300: lambda here: None,
    "pipe": lambda here: os.mkfifo(here / "pipe"),
    "loop": lambda here: (here / "loop").symlink_to("loop"),
    "nothing": lambda here: (here / "nothing").symlink_to("missing"),
}


@pytest.mark.parametrize("name", INSIDE)
def test_links_within_the_folder_are_followed(folder: Path, name: str) -> None:
    INSIDE[name](folder)
    assert read_below(folder, name) == b"own"


@pytest.mark.parametrize("name", OUTSIDE)
def test_nothing_outside_is_read(folder: Path, name: str) -> None:
    OUTSIDE[name](folder)
    assert (folder / name).read_text() == "secret"
    with pytest.raises(PermissionError, match="lies outside of"):
        read_below(folder, name)


@pytest.mark.parametrize("name", NO_FILE)
def test_what_is_no_file(folder: Path, name: str) -> None:
    NO_FILE[name](folder)
    with pytest.raises(OSError):  # noqa: PT011  which one is the system's
        read_below(folder, name)


@pytest.mark.parametrize("part", ["sub", "sub/own"])
def test_a_link_that_appears_after_the_path_was_resolved(
    folder: Path, part: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the last part, and before it."""
    (folder.parent / "outside" / "own").write_text("secret")
    resolved = os.path.realpath(folder / "sub/own", strict=True)

    def resolve(path: str, strict: bool) -> str:
        (folder / part).rename(folder / "away")
        (folder / part).symlink_to("../outside" if part == "sub" else "../../outside/own")
        return resolved

    monkeypatch.setattr(page_files.os.path, "realpath", resolve)
    with pytest.raises(OSError):  # noqa: PT011  Linux: it is too many links, or no folder
        read_below(folder, "sub/own")
    assert (folder / "sub/own").read_text() == "secret"


def test_links_that_change_meanwhile(folder: Path) -> None:
    """Another thread points the name to the inside and to the outside, in turn."""
    ended = threading.Event()

    def change() -> None:
        while not ended.is_set():
            for target in ("sub/own", "../outside/secret"):
                (folder / "new").symlink_to(target)
                (folder / "new").replace(folder / "link")

    (folder / "link").symlink_to("sub/own")
    other = threading.Thread(target=change)
    other.start()
    found, refused = [], 0
    try:
        for _ in range(2000):
            try:
                found.append(read_below(folder, "link"))
            except OSError:
                refused += 1
    finally:
        ended.set()
        other.join()
    assert set(found) == {b"own"}
    assert refused
