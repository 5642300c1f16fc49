"""Mutants: each is one change, still Python, drawn by a seed; and the counting of their fates."""

import ast
import textwrap
from pathlib import Path

import pytest

from comparisons.experiments.selftest.fault import PACKAGE, run_worker
from comparisons.experiments.selftest.mutants import functions_of, mutants
from comparisons.experiments.selftest.mutation import (
    FEW_RAYS,
    PLAIN,
    WORKER,
    Fate,
    by_few_rays,
    summary,
    write,
)

ROOT = Path(__file__).parents[3]


def package(folder: Path, text: str) -> Path:
    (folder / "core").mkdir()
    (folder / "core" / "a.py").write_text(textwrap.dedent(text))
    return folder


def test_kernels_of_the_package_are_found() -> None:
    found = functions_of(PACKAGE)
    assert len(found) > 500
    assert ("integrators/path.py", "radiances") in found
    assert ("accel/geometry.py", "closest_hit") in found  # an operation
    assert ("rendering/tiles.py", "render_tile") in found
    assert not any(name == "tabulate" for _, name in found)


@pytest.mark.slow
def test_mutants_are_one_change_each_and_python() -> None:
    found = mutants(PACKAGE, functions_of(PACKAGE), 60, 3)
    assert len({(m.file, m.function, m.line, m.what) for m in found}) > 55
    for mutant in found:
        tree = ast.parse(mutant.text)
        right = ast.parse((PACKAGE / mutant.file).read_text(encoding="utf-8"))
        a, b = ast.unparse(right).splitlines(), ast.unparse(tree).splitlines()
        assert len(a) == len(b)
        assert sum(x != y for x, y in zip(a, b, strict=True)) == 1, mutant


@pytest.mark.parametrize(
    ("line", "changes"),
    [
        ("return a + b", {"a - b"}),
        ("return a / b", {"a * b"}),
        ("return a < b", {"a > b"}),
        ("return a and b", {"a or b"}),
        ("return -a", {"+a"}),
        ("return not a", {"-a"}),
        ("return a[2]", {"3"}),
        ("return 0.5", {"0.525"}),
        ("return 0.0", {"0.05"}),
        ("return a.x", {"a.y"}),
        ("return min(a, b)", {"max"}),
        ("return math.sin(a)", {"math.cos"}),
        ("return a", set()),
        ("return 'a'", set()),
        ("return True", set()),
    ],
)
def test_every_kind_of_change(tmp_path: Path, line: str, changes: set[str]) -> None:
    root = package(tmp_path, f"@kernel\ndef f(a, b):\n    {line}\n\ndef g(a):\n    return a + 1\n")
    found = mutants(root, functions_of(root), 99, 0)
    assert {m.what.partition(" -> ")[2] for m in found} == changes
    assert all(m.function == "f" for m in found)


def fate(outcome: str, by: str = "") -> Fate:
    return Fate("f.py", "g", 7, "a + b -> a - b", outcome, by, "direct", "s", "why")


def test_shares_are_of_mutants_that_change_a_picture_and_a_suite_has_more_rays(tmp_path: Path):
    fates = [*[fate("caught", FEW_RAYS)] * 15, *[fate("caught", "smoke")] * 2]
    fates += [fate("caught", "standard"), *[fate("survives")] * 2, fate("same"), fate("fails")]
    text = summary(fates)
    assert text.startswith("20 of 22 mutants change a picture; 1 change none, 1 stop the renderer")
    assert "\nfew rays catches 15 of 20 " in text
    assert "\nsmoke catches 17 of 20 " in text
    assert "\nstandard catches 18 of 20 (68% to 99%)" in text
    assert text.count("- f.py:7 g: a + b -> a - b") == 2
    write(fates, 4, tmp_path)
    assert (tmp_path / "mutants.md").read_text() == text
    assert "smoke catches 1 of 1" in summary([fate("caught", "smoke")])
    assert "smoke catches 0 of 0" in summary([])


@pytest.mark.slow
def test_few_rays_catch_mutants_of_spheres_and_a_copy_without_a_change_is_the_same() -> None:
    path = str(ROOT / "scenes" / "material_blend.yaml")
    right = run_worker(WORKER, {"scenes": [path], "calls": True, "before": None}, PLAIN, None)
    before = {path: right[path]["picture"]}
    of_spheres = [p for p in functions_of(PACKAGE) if p[0] == "shapes/curved/sphere.py"]
    found = mutants(PACKAGE, of_spheres, 6, 0)
    assert "caught" in {by_few_rays(mutant, before).outcome for mutant in found}
    same = found[0]._replace(text=(PACKAGE / found[0].file).read_text(encoding="utf-8"))
    assert by_few_rays(same, before).outcome == "same"
