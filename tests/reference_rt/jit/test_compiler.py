"""pyproject.toml permits the release of Numba whose private parts we replace; a part that is gone
is named in one line."""

import runpy
import tomllib
from pathlib import Path

import numba
import pytest
from packaging.requirements import Requirement

from reference_rt.jit import compiler, numba_codegen
from reference_rt.jit.compiler import SUPPORTED

ROOT = Path(__file__).parents[3]


def test_pyproject_asks_for_what_is_supported():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (asked,) = (r for r in map(Requirement, project["dependencies"]) if r.name == "numba")
    release, minor = SUPPORTED.split(".")
    for version, fits in ((f"{SUPPORTED}.0", True), (f"{release}.{int(minor) + 1}.0", False)):
        assert (version in asked.specifier) == fits


@pytest.mark.parametrize(
    ("owner", "name"), compiler.REPLACED, ids=[f"{o.__name__}.{n}" for o, n in compiler.REPLACED]
)
def test_a_method_that_is_gone_is_named_in_one_line(owner, name, monkeypatch):
    for cls in owner.__mro__:
        if name in vars(cls):
            monkeypatch.delattr(cls, name)
    with pytest.raises(ImportError, match=rf"^Numba {numba.__version__}: .*{name}; expected: .*$"):
        runpy.run_path(str(compiler.__file__))


@pytest.mark.parametrize(
    ("owner", "name"), numba_codegen.NEEDED, ids=[n for _, n in numba_codegen.NEEDED]
)
def test_a_part_that_links_need_and_that_is_gone_is_named_in_one_line(owner, name, monkeypatch):
    for cls in getattr(owner, "__mro__", [owner]):
        if name in vars(cls):
            monkeypatch.delattr(cls, name)
    with pytest.raises(ImportError, match=rf"^Numba {numba.__version__}: .*{name}; expected: .*$"):
        runpy.run_path(str(numba_codegen.__file__))
