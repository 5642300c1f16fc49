"""`reference-rt variants` and `versions`: Mitsuba against itself."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from comparisons.commands.options import Limit, Scenes, compare_extra, out_folder, some_of, table_in
from comparisons.results import LIMIT
from reference_rt.cli.guarded import guarded, say
from reference_rt.util.errors import UsageError

if TYPE_CHECKING:
    from comparisons.commands.outputs import Outputs
    from comparisons.compare.budget import Budget
    from comparisons.results.case import Case

Some = Annotated[
    list[str] | None,
    typer.Argument(metavar="[SCENE]...", help="Scene files, or names of --scenes."),
]

Size = Annotated[str, typer.Option(metavar="WIDTHxHEIGHT", help="Size of the pictures.")]

Spp = Annotated[int, typer.Option(min=1, help="Samples per pixel of each picture.")]

Pictures = Annotated[int, typer.Option("--replicates", min=2, help="Pictures of each scene.")]

FILES = ("results.json", "report.html")

PARAMETERS = {"cornell_box": "materials.red.reflectance"}
"""Of these scenes derivatives are compared, too, by variants that have them."""


@guarded
def variants(
    scenes_named: Some = None,
    variant: Annotated[
        list[str] | None,
        typer.Option(help="Of Mitsuba; repeat it for several. (default: all that work here)"),
    ] = None,
    rays: Annotated[int, typer.Option(min=0, help="Rays of each plugin; 0: none.")] = 200_000,
    size: Size = "64x64",
    spp: Spp = 64,
    replicates: Pictures = 8,
    limit: Limit = 0.02,
    scenes: Scenes = Path("scenes"),
    out: Annotated[Path, out_folder("results.json and report.html")] = Path("out/variants"),
    markdown: Annotated[Path | None, table_in("variants")] = None,
) -> None:
    """Compare Mitsuba's variants: scalar, llvm, and cuda where a GPU is present.

    Rays of the plugins of shapes, half of them aimed at edges; pictures of scenes, by default the
    Cornell box; derivatives where there are.

    Exit code: 0 if nothing differs (pictures may be too noisy to tell), 1 if something does.
    """
    with compare_extra():
        from comparisons.commands.outputs import Outputs
        from comparisons.experiments import variants as by
        from comparisons.report.table import Column, Table

    writes = Outputs(out, FILES, markdown=(markdown, "variants"))
    writes.check()
    paths = _paths(scenes_named or ["cornell_box"], scenes)
    found, left_out = by.works()
    if variant:
        found = list(some_of("--variant", variant, found))
    if len(found) < 2:
        raise UsageError(f"expected two variants, got {', '.join(found)}; {'; '.join(left_out)}")
    width_height = _budget(size, spp, replicates, limit).size
    assert width_height is not None
    moved = {str(p): PARAMETERS[p.stem] for p in paths if p.stem in PARAMETERS}
    task = by.Task(tuple(map(str, paths)), rays, width_height, spp, replicates, derivatives=moved)

    def cases() -> tuple[list["Case"], list[str]]:
        return by.run(found, task, limit, lambda line: say(line, err=True)), left_out

    columns: tuple[Column[Any], ...] = (
        Column("what", lambda case: case.scene),
        Column("verdict", lambda case: case.verdict),
        Column("why", lambda case: case.reason),
    )
    _finish(cases, writes, lambda made: Table(columns, list(made)), {})


@guarded
def versions(
    names: Annotated[
        list[str], typer.Argument(metavar="VERSION...", help="Two or more, the oldest first.")
    ],
    of: Annotated[str, typer.Option(help="The renderer: mitsuba.")] = "mitsuba",
    scene: Annotated[
        list[str] | None,
        typer.Option(help="A scene file, or a name of --scenes; repeat it for several."),
    ] = None,
    size: Size = "64x64",
    spp: Spp = 32,
    replicates: Pictures = 8,
    limit: Limit = LIMIT,
    scenes: Scenes = Path("scenes"),
    out: Annotated[Path, out_folder("results.json and report.html")] = Path("out/versions"),
    markdown: Annotated[Path | None, table_in("versions")] = None,
) -> None:
    """Compare versions of Mitsuba: which scenes changed their picture, by how much, since when.

    Each version gets an environment of its own in the cache, by pip. Scenes that need plugins of
    ours are left out.

    Exit code: 0 if no picture changed, 1 if one did, 4 if a version cannot be installed.
    """
    with compare_extra():
        from comparisons.commands.outputs import Outputs
        from comparisons.experiments import versions as by
        from comparisons.mitsuba.backend import backend

    writes = Outputs(out, FILES, markdown=(markdown, "versions"))
    writes.check()
    if of != "mitsuba":
        raise UsageError(f"--of: expected mitsuba, got '{of}'")
    if len(names) < 2:
        raise UsageError("expected two versions or more, the oldest first")
    paths = _paths(scene or sorted(path.stem for path in scenes.glob("*.yaml")), scenes)
    budget = _budget(size, spp, replicates, limit)
    facts = {"versions": ", ".join(names)}

    def cases() -> tuple[list["Case"], list[str]]:
        return by.compared(names, paths, budget, backend(), lambda line: say(line, err=True))

    _finish(cases, writes, by.table, facts)


def _paths(given: Sequence[str], folder: Path) -> list[Path]:
    """Files, and names of scenes in a folder, without repeated ones.  Raises UsageError."""
    found: dict[str, Path] = {}
    for name in given:
        path = Path(name) if Path(name).suffix else folder / f"{name}.yaml"
        if not path.is_file():
            raise UsageError(f"{path}: there is no such file; expected a scene")
        if path != (other := found.setdefault(path.stem, path)):
            raise UsageError(f"{other} and {path}: have the same name; expected one of them")
    if not found:
        raise UsageError(f"{folder}: has no scenes")
    return list(found.values())


def _budget(size: str, spp: int, replicates: int, limit: float) -> "Budget":
    from comparisons.compare.budget import Budget
    from reference_rt.cli.quantities import size_of

    return Budget(size=size_of(size), spp=spp, replicates=replicates, limit=limit)


def _finish(
    made: Callable[[], tuple[list["Case"], list[str]]],
    writes: "Outputs",
    table: Callable[[Sequence["Case"]], Any],
    facts: dict[str, Any],
) -> None:
    """Write the page and results.json of the cases, and say what was found."""
    from comparisons.report import terminal, write_report, write_results
    from comparisons.runs.provenance import provenance

    writes.prepare()
    begun = time.perf_counter()
    cases, left_out = made()
    told = {**provenance(), **facts} | ({"left out": "; ".join(left_out)} if left_out else {})
    told |= {"seconds": round(time.perf_counter() - begun, 1)}
    results, page = writes.files
    write_results(results, cases, told)
    write_report(page, cases, told, title=writes.markdown[1], walls={})
    rows = table(cases)
    console = terminal.console()
    if rows.rows:
        console.print(rows.terminal(console.width))
    for line in left_out:
        say(f"left out: {line}")
    failed = [case for case in cases if case.verdict in ("differ", "invalid")]
    count = len(cases)
    say(f"{count} cases, {len(failed)} of them differ")
    writes.finish(lambda: "\n".join(rows.markdown()))
    raise typer.Exit(1 if failed else 0)
