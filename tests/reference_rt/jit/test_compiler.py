"""Numba's own compiler replaces ours where ours does not fit, with the same bits."""

import importlib.metadata
import os
import runpy
import subprocess
import sys
import tomllib
import warnings
from pathlib import Path

import numba
import numpy as np
import pytest
from packaging.requirements import Requirement

from reference_rt.core.exr import read_exr
from reference_rt.jit import compiler, function_pointer, numba_codegen, numba_pipeline
from reference_rt.jit import kernel as kernel_module
from reference_rt.jit.compiler import CHOICE, INLINING, STOCK, SUPPORTED
from reference_rt.jit.function_pointer import call_pointer, pointer_to
from reference_rt.jit.kernel import entry_kernel, precompile, signature_of

ROOT = Path(__file__).parents[3]

needs_jit = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")


@pytest.fixture(autouse=True)
def _nothing_is_named(monkeypatch):
    monkeypatch.delenv(CHOICE, raising=False)


# ---- which one ----------------------------------------------------------------------------------


def test_the_installed_numba_is_supported():
    assert compiler.choose().name == INLINING


def test_pyproject_asks_for_what_is_supported():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (asked,) = (r for r in map(Requirement, project["dependencies"]) if r.name == "numba")
    release, minor = SUPPORTED.split(".")
    for version, fits in ((f"{SUPPORTED}.0", True), (f"{release}.{int(minor) + 1}.0", False)):
        assert (version in asked.specifier) == fits


@pytest.mark.parametrize("version", ["0.67.1", "0.69.0", "0.69.0rc1", "0.680.0", "1.68.0"])
def test_another_release_is_reported_in_one_line(version, monkeypatch):
    monkeypatch.setattr(numba, "__version__", version)
    with pytest.warns(RuntimeWarning) as told:
        chosen = compiler.choose()
    assert chosen.name == STOCK
    (one,) = told
    text = warnings.formatwarning(one.message, one.category, one.filename, one.lineno)
    assert version in text
    assert f"Numba {SUPPORTED}" in text
    assert text.count("\n") == 1


@pytest.mark.parametrize("version", ["0.68.1", "0.69.0"])
def test_the_stock_compiler_is_chosen_without_a_warning(version, monkeypatch):
    monkeypatch.setenv(CHOICE, STOCK)
    monkeypatch.setattr(numba, "__version__", version)
    assert compiler.choose().name == STOCK


def test_ours_is_tried_with_any_release_where_it_is_named(monkeypatch):
    monkeypatch.setenv(CHOICE, INLINING)
    monkeypatch.setattr(numba, "__version__", "0.69.0")
    assert compiler.choose().name == INLINING


@pytest.mark.parametrize(
    ("owner", "name"),
    numba_pipeline.REPLACED,
    ids=[f"{o.__name__}.{n}" for o, n in numba_pipeline.REPLACED],
)
def test_a_method_that_is_gone_is_found_when_ours_is_imported(owner, name, monkeypatch):
    for cls in owner.__mro__:
        if name in vars(cls):
            monkeypatch.delattr(cls, name)
    with pytest.raises(ImportError, match=name):
        runpy.run_path(str(numba_pipeline.__file__))


@pytest.mark.parametrize(
    ("owner", "name"), numba_codegen.NEEDED, ids=[n for _, n in numba_codegen.NEEDED]
)
def test_a_part_that_links_need_and_that_is_gone_is_named_in_one_line(owner, name, monkeypatch):
    for cls in getattr(owner, "__mro__", [owner]):
        if name in vars(cls):
            monkeypatch.delattr(cls, name)
    with pytest.raises(ImportError, match=rf"^Numba {numba.__version__}: .*{name}; expected: .*$"):
        runpy.run_path(str(numba_codegen.__file__))


def test_options_that_numba_does_not_know_are_left_out(monkeypatch):
    """Numba refuses to compile with one it does not know."""

    class Options:
        error_model = nogil = None

    monkeypatch.setattr(compiler.cpu_target, "options", Options)
    stock = compiler._stock()
    assert stock.kernel == stock.callee == {"error_model": "numpy"}
    assert stock.entry.keys() == {"error_model", "nogil"}


# ---- the same bits ------------------------------------------------------------------------------

_BALL = """
camera: {type: perspective, eye: [0, 1, 4], target: [0, 0.5, 0], fov: 40}
film: {width: 16, height: 16}
sampler: {type: sobol, spp: 4, seed: 1}
integrator: {type: path, max_depth: 3}
materials: {grey: {type: diffuse, reflectance: 0.5}}
shapes: [{type: sphere, material: grey, center: [0, 0.5, 0]}]
lights: [{type: constant, radiance: 0.1}]
"""

# Numba itself has it from elsewhere, and works on.
_RENAMED = "from numba.core import untyped_passes; del untyped_passes.WithLifting"

_MAIN = "import sys; from reference_rt.cli.main import main; sys.argv[0] = 'reference-rt'; main()"


def render(scene, picture, before="", **environment):
    """What `reference-rt render` wrote to standard error, and its exit code."""
    arguments = "render", str(scene), "-o", str(picture), "--size", "16x16", "--spp", "4"
    done = subprocess.run(
        [sys.executable, "-c", f"{before}\n{_MAIN}", *arguments],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stderr, done.returncode


def same_pictures(one, other):
    (a, _), (b, _) = read_exr(one), read_exr(other)
    return a.keys() == b.keys() and all(np.array_equal(a[k], b[k], equal_nan=True) for k in a)


@pytest.mark.slow
@needs_jit
def test_a_renamed_part_leaves_the_same_bits(tmp_path):
    scene = tmp_path / "ball.yaml"
    scene.write_text(_BALL)
    ours, fallback, stock = (tmp_path / f"{k}.exr" for k in ("ours", "fallback", "stock"))
    assert "warning" not in render(scene, ours)[0].lower()
    told, code = render(scene, fallback, before=_RENAMED)
    (warning,) = [line for line in told.splitlines() if "Warning" in line]
    assert code == 0
    assert SUPPORTED in warning
    assert importlib.metadata.version("numba") in warning
    assert "WithLifting" in warning
    assert "Traceback" not in told
    assert same_pictures(ours, fallback)
    told, code = render(scene, stock, **{CHOICE: STOCK})
    assert ("warning" in told.lower(), code) == (False, 0)
    assert same_pictures(ours, stock)
    assert len(np.unique(read_exr(stock)[0]["R"])) > 10


@pytest.mark.slow
@needs_jit
@pytest.mark.parametrize(
    "name",
    [
        "cornell_box",
        "csg_coincident",
        "instances",
        "mesh_knot",  # with its tracer apart
        "material_principled",
        "textured_room",
        "whitted_classic",
    ],
)
def test_scenes_have_the_same_bits(name, tmp_path):
    scene, pictures = ROOT / "scenes" / f"{name}.yaml", [tmp_path / "a.exr", tmp_path / "b.exr"]
    for choice, picture in zip((INLINING, STOCK), pictures, strict=True):
        assert render(scene, picture, **{CHOICE: choice})[1] == 0
    assert same_pictures(*pictures)


@needs_jit
def test_a_compiler_that_is_none_is_one_line(tmp_path):
    scene = tmp_path / "ball.yaml"
    scene.write_text(_BALL)
    told, code = render(scene, tmp_path / "out.exr", **{CHOICE: "fast"})
    assert told == f"error: {CHOICE}=fast: unknown; expected {INLINING} or {STOCK}\n"
    assert code == 2
    assert not (tmp_path / "out.exr").exists()


def _add(x, pair, out):
    out[0] = x + pair[0] * pair[1]


def _add_at(address, x, pair, out):
    call_pointer(address[0], (x, pair, out))


@needs_jit
def test_the_stock_compiler_calls_at_an_address(monkeypatch):
    monkeypatch.setattr(kernel_module, "COMPILER", compiler._stock())
    monkeypatch.setattr(function_pointer, "COMPILER", compiler._stock())
    monkeypatch.setattr(kernel_module, "CACHE_FOLDER", None)
    out = np.zeros(1)
    arguments = 0.5, (2.0, 3.0), out
    signature = signature_of(*arguments)
    called = entry_kernel(_add)
    precompile(called, signature)
    entry_kernel(_add_at)(np.array([pointer_to(called, signature)], np.intp), *arguments)
    assert out[0] == 6.5
