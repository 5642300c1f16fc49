"""LLVM libraries for Mitsuba: which are tried, in which order, and what each needs."""

import os
import shutil
import sys
from pathlib import Path

import pytest

from comparisons.mitsuba import backend
from comparisons.mitsuba import llvm_libraries as libraries

_FOUND = [path for path in libraries._files_of_wheel() if libraries.version_of(str(path))]
_NEEDED = libraries.needed_by(str(_FOUND[0])) if _FOUND else []

needs_wheel = pytest.mark.skipif(not _FOUND, reason="there is no such wheel for this machine")


@pytest.fixture(autouse=True)
def _nothing_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("REFERENCE_RT_CACHE", str(tmp_path / "cache"))
    for name in (backend.FORCE, libraries.LIBRARY, "CONDA_PREFIX"):
        monkeypatch.delenv(name, raising=False)
    # As in a new process: other tests of this one have loaded an LLVM.
    monkeypatch.delitem(sys.modules, "drjit", raising=False)


@pytest.fixture
def places(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> tuple[Path, Path]:
    """Two folders that stand for the wheel and for the system, both empty."""
    wheel, system = tmp_path / "wheel", tmp_path / "system"
    for folder in (wheel, system):
        folder.mkdir()
    monkeypatch.setattr(libraries, "_files_of_wheel", lambda: sorted(wheel.rglob("*.so*")))
    monkeypatch.setattr(libraries, "_PLACES", (f"{system}/libLLVM*.so*",))
    return wheel, system


@pytest.mark.parametrize(
    ("path", "version"),
    [
        ("/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1", (19, 1)),
        ("/usr/lib/llvm-14/lib/libLLVM-14.0.6.so.1", (14, 0, 6)),
        ("/usr/lib64/libLLVM-15.so", (15,)),
        ("/opt/homebrew/opt/llvm@18/lib/libLLVM.dylib", (18,)),
        ("/opt/homebrew/opt/llvm/lib/libLLVM.dylib", (0,)),
        ("/usr/lib/llvm-14/lib/libLLVMAnalysis.so", ()),
        ("/venv/lib/libLTO.so.19.1", ()),
    ],
)
def test_versions_are_read_from_names(path: str, version: tuple[int, ...]) -> None:
    assert libraries.version_of(path) == version


def test_the_wheel_comes_first_then_the_newest_of_the_system(places: tuple[Path, Path]) -> None:
    wheel, system = places
    names = "libLLVM-9.so.1", "libLLVM.so.20.1", "libLLVM-14.0.6.so.1"
    for name in names:
        (system / name).touch()
    (system / "libLLVM-20.so").symlink_to(system / "libLLVM.so.20.1")
    newest_first = [str(system / names[k]) for k in (1, 2, 0)]
    assert libraries.candidates() == newest_first
    (wheel / "libLLVM.so.19.1").touch()
    (wheel / "libLTO.so.19.1").touch()
    assert libraries.candidates() == [str(wheel / "libLLVM.so.19.1"), *newest_first]


def test_only_the_users_own_is_tried_where_one_is_named(
    places: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    (places[0] / "libLLVM.so.19.1").touch()
    monkeypatch.setenv(libraries.LIBRARY, "/some/libLLVM.so")
    assert libraries.candidates() == ["/some/libLLVM.so"]
    assert libraries.needed_by("/some/libLLVM.so") == []


def test_a_library_of_the_wheel_that_fails_leaves_it_to_the_systems(
    places: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Proven in a child process, each by itself."""
    wheel, system = places
    broken, works = wheel / "libLLVM.so.19.1", system / "libLLVM.so.18.1"
    broken.write_text("not a library")
    works.write_text("is taken for one")
    tried = []
    prove = backend.prove

    def proof(variant: str, path: str | None) -> str | None:
        tried.append(path)
        return None if path == str(works) else prove(variant, path)

    monkeypatch.setattr(backend, "prove", proof)
    chosen = backend.choose()
    assert tried == [str(broken), str(works)]
    assert (chosen.variant, chosen.llvm_path) == (backend.LLVM, str(works))
    assert str(works) in chosen.reason


@needs_wheel
def test_the_wheels_library_renders(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the system has none."""
    monkeypatch.setattr(libraries, "_PLACES", ())
    chosen = backend.choose()
    assert (chosen.variant, chosen.llvm_path) == (backend.LLVM, str(_FOUND[0]))


@needs_wheel
def test_the_wheels_library_renders_without_the_links_that_it_makes(
    places: tuple[Path, Path],
) -> None:
    """They are made when Python first starts, by whoever may write there."""
    wheel, _ = places
    for file in (str(_FOUND[0]), *_NEEDED):
        shutil.copy(file, wheel)
    library = str(wheel / _FOUND[0].name)
    needed = [Path(path).name for path in libraries.needed_by(library)]
    assert [name.partition(".so")[0] for name in needed] == ["libunwind", "libc++abi", "libc++"]
    assert not os.path.lexists(wheel / "libc++.so.1")
    assert backend.prove(backend.LLVM, library) is None
