"""The scripts of examples/ run, and print what their numbers must be."""

import ast
import gc
import itertools
import json
import re
import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@pytest.fixture
def run(monkeypatch, capsys):
    def run(name, *arguments):
        monkeypatch.chdir(ROOT)
        monkeypatch.setattr(sys, "argv", [name, *arguments])
        runpy.run_path(f"examples/{name}.py", run_name="__main__")
        return capsys.readouterr().out

    return run


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_uses_public_names(path):
    """Of a package itself, not of its modules."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    froms = {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    names = {a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names}
    ours = {n for n in froms | names if n.startswith(("reference_rt", "comparisons"))}
    assert ours <= {"reference_rt", "comparisons"}


@pytest.mark.parametrize("name", ["batch", "cluster"])
def test_an_example_without_arguments_says_how_it_is_used(run, name):
    if name == "cluster":
        pytest.importorskip("distributed")
    with pytest.raises(SystemExit, match=rf"`python examples/{name}.py FOLDER OUT"):
        run(name)


def test_every_example_is_tested():
    tests = Path(__file__).read_text(encoding="utf-8")
    assert [path.stem for path in EXAMPLES if f'run("{path.stem}"' not in tests] == []


def test_own_material(run):
    """Each mistake is seen, and nothing where there is none."""
    parts = re.split(r"^(?=\S)", run("own_material"), flags=re.MULTILINE)[1:]
    assert [part.count("FAILED") for part in parts] == [0, 2, 3, 2]
    assert all(part.count("passed") + part.count("FAILED") == 4 for part in parts)


def test_oracle(run):
    """float64 leaves the textbook's formula 1e-16 of 1e10 = (1e5 radii)^2, halved by the root."""
    error = float(re.search(r"up to (\S+) radii", run("oracle"))[1])
    assert 1e-6 < error < 1e-3


def test_furnace(run):
    lost = [float(x) for x in re.findall(r"([\d.]+)%", run("furnace"))]
    assert lost == sorted(lost)
    assert lost[0] < 1 < lost[-1]


@pytest.mark.slow
def test_two_samplers(run):
    rows = [line.split() for line in run("two_samplers").splitlines()[1:]]
    assert [row[0] for row in rows] == ["16", "64", "256"]
    for *_, independent, sobol in rows:
        assert float(sobol.strip("%")) < float(independent.strip("%"))


def test_gradient(run):
    right, wrong = run("gradient").splitlines()
    assert "whole: agree" in right
    assert "without the distance: differ" in wrong


def test_lens(run):
    near, exact = re.findall(r"= (\d\.\d+); by .* (\d\.\d+)", run("lens"))[0]
    assert abs(float(near) - float(exact)) < 1e-3


@pytest.fixture
def folder(tmp_path):
    """Of two scenes, and one that is none."""
    scene = (ROOT / "scenes/light_spot.yaml").read_text(encoding="utf-8")
    for name, text in (("a", scene), ("b", scene), ("c", "shapes: [{type: spher}]")):
        (tmp_path / f"{name}.yaml").write_text(text, encoding="utf-8")
    return tmp_path


def test_batch(run, folder):
    said = run("batch", str(folder), str(folder / "sheet.png"))
    assert said.count("<Picture 80 x") == 2
    assert "c.yaml:1" in said
    assert (folder / "sheet.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.filterwarnings("default")  # of Dask's
def test_cluster(run, folder):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(1, processes=False, dashboard_address=None) as cluster:
        said = run("cluster", str(folder), str(folder / "out"), cluster.scheduler_address)
    gc.collect()  # else it warns of Dask's sockets in whatever test it runs
    assert said.count("<Picture ") == 2
    assert "c.yaml: " in said
    assert sorted(path.name for path in (folder / "out").iterdir()) == ["a.exr", "b.exr"]


@pytest.mark.cases(1)
@pytest.mark.parametrize(("power", "verdict"), [("0.5", "agree"), ("0.4", "differ")])
def test_gate_a_renderer(run, power, verdict):
    assert run("gate_a_renderer", power).startswith(verdict)


NOTEBOOKS = {
    path.stem: [
        cell
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]
        if cell["cell_type"] == "code"
    ]
    for path in (ROOT / "examples").glob("*.ipynb")
}
"""The cells of code of each."""


def test_a_notebook_is_stored_with_its_outputs():
    """Readers of the repository see them; what they hold is what the tests below compute."""
    kinds = {"tour": ["html", "", "", "html"], "is_it_right": ["png", "html", "text"]}
    assert set(NOTEBOOKS) == set(kinds)
    for name, cells in NOTEBOOKS.items():
        assert [c["execution_count"] for c in cells] == list(range(1, len(cells) + 1))
        for cell, kind in zip(cells[1:], kinds[name], strict=True):
            output, *_ = cell["outputs"]
            shown = {key.rpartition("/")[2] for key in output.get("data", {})} or {"text"}
            assert (kind or "plain") in shown
            assert str(Path.home()) not in json.dumps(cell["outputs"])
        assert (ROOT / f"examples/{name}.ipynb").stat().st_size < 100_000
    assert "agree" in "".join(NOTEBOOKS["tour"][-1]["outputs"][0]["data"]["text/html"])


def cells_run(name):
    """What each cell shows: the value of its last line, as in Jupyter."""
    names = {"__name__": "__main__"}
    for source in ("".join(cell["source"]) for cell in NOTEBOOKS[name]):
        *first, last = ast.parse(source).body
        exec(compile(ast.Module(first, []), name, "exec"), names)
        if isinstance(last, ast.Expr):
            yield eval(compile(ast.Expression(last.value), name, "eval"), names)
        else:
            exec(compile(ast.Module([last], []), name, "exec"), names)
            yield None


@pytest.mark.slow
def test_tour(monkeypatch):
    monkeypatch.chdir(ROOT)
    _, picture, fields, (t, shape, _), case = cells_run("tour")
    assert picture._repr_png_().startswith(b"\x89PNG")
    assert "data:image/png" in picture._repr_html_()
    assert all(fields.values())
    assert (t[0], shape[0]) == (3.0, 0)
    assert case.verdict == "agree"
    page = case._repr_html_()
    assert page.count("<img") == 3
    assert "agree" in page
    assert "reference_rt" not in repr(case)
    assert repr(case).startswith("<Case scene: agree: no difference was found")


@pytest.mark.slow
def test_is_it_right(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    case, figure, wrong, _ = cells_run("is_it_right")
    assert case.verdict == "agree", case.reason
    for line in figure.axes[0].lines:
        _, errors = line.get_xydata().T
        # 4 times the samples: a quarter of the squared error, with half as much for chance.
        assert len(errors) == 4
        assert all(after < before / 2 for before, after in itertools.pairwise(errors))
    assert wrong.verdict == "differ"
    said = capsys.readouterr().out
    found, expected = (
        [float(x) for x in text.split()] for text in re.findall(r"\[([\d. ]+)\]", said)[:2]
    )
    assert all(one > other for one, other in zip(found, expected, strict=True))
    first = re.search(r"hits shapes\[\d\], rectangle, material '(\w+)'", said)
    assert first[1] == "red"


def test_two_back_ends(run):
    said = run("two_back_ends")
    assert said.startswith("differ - paired: ")
    assert "half floats: B's values" in said
    assert run("two_back_ends", "float32").startswith("agree - paired: ")
