"""Which variant of Mitsuba works is found out in child processes, and reported."""

import ast
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

from comparisons.commands.doctor import checks
from comparisons.mitsuba import backend
from comparisons.mitsuba.llvm_libraries import LIBRARY
from comparisons.runs import provenance
from reference_rt.util.errors import ReferenceUnavailableError, SceneWarning


@pytest.fixture(autouse=True)
def _own_memory(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("REFERENCE_RT_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv(backend.FORCE, raising=False)
    monkeypatch.delenv(LIBRARY, raising=False)
    # As in a new process: other tests of this one have loaded an LLVM.
    monkeypatch.delitem(sys.modules, "drjit", raising=False)


@pytest.fixture
def bogus(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> str:
    """A library that is none."""
    path = tmp_path / "libLLVM.so.99.1"
    path.write_text("not a library")
    monkeypatch.setenv(LIBRARY, str(path))
    return str(path)


def test_a_library_that_fails_leaves_scalar_and_says_how_to_get_llvm(bogus: str) -> None:
    chosen = backend.choose()
    assert chosen.variant == "scalar_rgb"
    assert chosen.llvm_path is None
    assert chosen.version
    assert bogus in chosen.reason
    assert "reference-rt[compare]" in chosen.reason
    assert "libllvm19" in chosen.reason
    assert "\n" not in chosen.reason


def test_what_was_proven_is_remembered_until_the_file_changes(
    bogus: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    proofs = []

    def count(variant: str, path: str | None) -> str | None:
        proofs.append((variant, path))
        return None

    monkeypatch.setattr(backend, "prove", count)
    assert backend.choose().variant == "llvm_ad_rgb"
    assert backend.choose().llvm_path == bogus
    assert proofs == [("llvm_ad_rgb", bogus)]
    Path(bogus).write_text("another file of another size")
    stat = Path(bogus).stat()
    os.utime(bogus, ns=(stat.st_atime_ns, stat.st_mtime_ns + 10**9))
    backend.choose()
    assert len(proofs) == 2


@pytest.mark.parametrize(
    ("problem", "times"), [("ends the process by signal 4", 1), ("fails: lacks another one", 2)]
)
def test_what_others_may_mend_is_tried_again(
    bogus: str, monkeypatch: pytest.MonkeyPatch, problem: str, times: int
) -> None:
    proofs = []
    monkeypatch.setattr(backend, "prove", lambda *which: proofs.append(which) or problem)
    assert backend.choose().llvm_path is None
    assert problem in backend.choose().reason
    assert len(proofs) == times


def test_a_broken_memory_is_none(bogus: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut anywhere, or of other types than were written: proven again, and whole afterwards."""
    file = backend._memory_file()
    monkeypatch.setattr(backend, "prove", lambda variant, path: None)
    backend.choose()
    whole = file.read_bytes()
    others = (
        b"[]",
        b"null",
        b"\xff\xfe",
        whole.replace(b"null", b"5"),
        whole.replace(b"null", b"{}"),
    )
    for damaged in (*(whole[:k] for k in range(0, len(whole), 7)), *others):
        file.write_bytes(damaged)
        assert backend.choose().llvm_path == bogus
        assert file.read_bytes() == whole


def test_an_abort_of_the_child_is_reported_and_not_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "_PROOF", "import os; os.abort()")
    assert backend.prove("llvm_ad_rgb", None) == "ends the process by signal 6"


def test_a_child_that_hangs_is_ended_and_not_remembered(
    bogus: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(backend, "_PROOF", "import time; time.sleep(60)")
    monkeypatch.setattr(backend, "_PROOF_SECONDS", 0.2)
    assert "did not answer" in backend.choose().reason
    assert not backend._memory_file().exists()


def test_a_wrong_picture_is_no_proof(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "_PROOF", "import sys; sys.exit(3)")
    assert backend.prove("llvm_ad_rgb", None) == "renders a wrong picture"


def test_the_proof_renders_in_the_simplest_variant() -> None:
    assert backend.prove("scalar_rgb", None) is None


def test_another_version_is_doubtful(monkeypatch: pytest.MonkeyPatch) -> None:
    """The command line prints it, and so does `doctor`."""
    monkeypatch.setenv(backend.FORCE, "scalar_rgb")
    assert backend.choose().doubt == ""
    other = replace(backend.choose(), version="3.8.0")
    assert "3.8.0" in other.doubt
    monkeypatch.setattr(provenance, "backend", lambda: other)
    with pytest.warns(SceneWarning, match="Mitsuba 3.8.0 is installed"):
        provenance.provenance()
    monkeypatch.setattr(backend, "choose", lambda: other)
    (check,) = (check for check in checks() if check.what == "Mitsuba")
    assert "Mitsuba 3.8.0 is installed" in check.advice


def test_forced_variants(monkeypatch: pytest.MonkeyPatch, bogus: str) -> None:
    monkeypatch.setenv(backend.FORCE, "scalar_rgb")
    assert backend.choose().variant == "scalar_rgb"
    assert backend.FORCE in backend.choose().reason
    monkeypatch.setenv(backend.FORCE, "llvm_ad_rgb")
    with pytest.raises(ReferenceUnavailableError, match=r"libLLVM.so.99.1"):
        backend.choose()
    monkeypatch.setenv(backend.FORCE, "no_such_variant")
    with pytest.raises(ReferenceUnavailableError, match="no_such_variant"):
        backend.choose()


def test_without_mitsuba_the_error_says_how_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ReferenceUnavailableError, match=r"reference-rt\[compare\]") as caught:
        backend.choose()
    assert caught.value.exit_code == 4


def test_importing_the_comparisons_does_not_import_mitsuba() -> None:
    modules = "comparisons.mitsuba.backend, comparisons.translator, comparisons.rungs"
    code = f"import sys, {modules}; sys.exit('mitsuba' in sys.modules or 'drjit' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


FIRST = {
    "nothing": "pass",
    "a choice, and Dr.Jit by somebody else": "backend.backend(); import drjit",
    "the module": "backend.mitsuba()",
    "the scalar variant": "backend.scalar().__enter__()",
    "a file": "Scene.load(file)",
    "a file without what is not supported": "Scene.load(file, allow_missing=True)",
    "a file and its values": "Scene.load(file, defaults={'radius': '2'})",
    "a dictionary": "Scene.from_mitsuba({'type': 'scene', 'ball': {'type': 'sphere'}})",
    "an error in a file": "suppress(SceneError).__enter__(); Scene.load(file + '.none')",
    "writing": "write_xml(Scene(), Path(file).with_name('out.xml'))",
}
"""What a process may do first with Mitsuba, in Python."""

_LOADED = """
import sys
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from comparisons.commands.doctor import checks
from comparisons.mitsuba import backend
from comparisons.mitsuba.llvm_libraries import LIBRARY
from comparisons.translator.writing import write_xml
from reference_rt import Scene
from reference_rt.util.errors import SceneError
file = sys.argv[1]
try:
    {first}
except SceneError:
    pass
backend.mitsuba()
lines = Path("/proc/self/maps").read_text().splitlines()
print(backend.backend().llvm_path)
print(*{{line.split()[-1] for line in lines if "libLLVM" in line}})
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("first", FIRST)
def test_dr_jit_has_the_proven_llvm_whatever_comes_first(first: str, tmp_path: Path) -> None:
    """Dr.Jit loads an LLVM when it is imported.  Where a scene of Mitsuba's was read first, that
    was whichever the system has, such as an old one that aborts in some kernels."""
    file = tmp_path / "scene.xml"
    file.write_text(
        "<scene version='3.0.0'><default name='radius' value='1'/>"
        "<shape type='sphere'><float name='radius' value='$radius'/></shape></scene>"
    )
    code = _LOADED.format(first=FIRST[first])
    run = subprocess.run(
        [sys.executable, "-c", code, str(file)], check=True, capture_output=True, text=True
    )
    proven, loaded = run.stdout.splitlines()[-2:]
    if proven == "None":
        pytest.skip("no LLVM works here")
    assert loaded == str(Path(proven).resolve())


def test_only_the_backend_imports_mitsuba() -> None:
    """For the same reason; `render_xml.py` runs in environments of other Mitsubas.  Dr.Jit is
    imported in functions, which are called after that; a test file that imports it would change the
    library of all tests, since all files are read first."""
    package = Path(backend.__file__).parents[1]
    allowed = {Path(backend.__file__)}
    others = {package / "experiments/render_xml.py"}
    files = {*package.rglob("*.py"), *Path(__file__).parents[2].rglob("*.py")}
    for file in files - others:
        text = file.read_text(encoding="utf-8")
        if not re.search(r"\bimport\b.*\b(mitsuba|drjit)\b", text):
            continue
        tree = ast.parse(text)
        within = file in allowed or package not in file.parents
        for name, nodes in (
            ("drjit", tree.body),
            ("mitsuba", tree.body if within else ast.walk(tree)),
        ):
            imports = [node for node in nodes if isinstance(node, ast.Import)]
            found = {n.name.partition(".")[0] for node in imports for n in node.names}
            assert name not in found, file


def test_an_llvm_that_is_loaded_already_is_the_one_that_is_proven(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where the user's code has imported Dr.Jit: another library would be named, not used."""
    tried = []
    monkeypatch.setattr(backend, "prove", lambda variant, path: tried.append(path))
    monkeypatch.setattr(backend.llvm_libraries, "candidates", lambda: ["libLLVM.so.99.1"])
    monkeypatch.setitem(sys.modules, "drjit", ModuleType("drjit"))
    chosen = backend.choose()
    assert (chosen.variant, chosen.llvm_path, tried) == (backend.LLVM, None, [None])
    assert "Dr.Jit had loaded" in chosen.reason
    monkeypatch.setenv(LIBRARY, "libLLVM.so.98.1")
    assert backend.choose().llvm_path == "libLLVM.so.98.1"
    monkeypatch.delitem(sys.modules, "drjit")
    monkeypatch.delenv(LIBRARY)
    assert backend.choose().llvm_path == "libLLVM.so.99.1"


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="processes keep all cores here")
@pytest.mark.parametrize("how", ["ours", "another Mitsuba's"])
def test_on_one_core_bitmaps_are_read(how: str, tmp_path: Path) -> None:
    """With one thread Mitsuba 3.9.1 waits for ever for the one that decodes an .exr file."""
    scenes = Path(__file__).parents[3] / "scenes"
    sky = scenes / "textures/sky.exr"
    one_core = "import os, sys; os.sched_setaffinity(0, [min(os.sched_getaffinity(0))]); "
    if how == "ours":
        read = f"from comparisons.mitsuba.backend import mitsuba; mitsuba().Bitmap({str(sky)!r})"
    else:
        (tmp_path / "sky.xml").write_text(
            "<scene version='3.0.0'><integrator type='path'/><emitter type='envmap'>"
            f"<string name='filename' value='{sky}'/></emitter>"
            "<sensor type='perspective'><film type='hdrfilm'><integer name='width' value='4'/>"
            "<integer name='height' value='4'/></film></sensor></scene>"
        )
        read = (
            "from comparisons.experiments import render_xml; from pathlib import Path; "
            f"render_xml.main('scalar_rgb', Path({str(tmp_path)!r}), 1, 1, ['sky'])"
        )
    # Ended and failed if it takes longer: on an idle machine it takes a second.
    subprocess.run([sys.executable, "-c", one_core + read], check=True, timeout=300)
    if how != "ours":
        assert (tmp_path / "sky.npy").exists()
