"""`reference-rt compare`."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from comparisons.commands.extra import compare_extra
from reference_rt.cli import adjusted, guarded
from reference_rt.scene import Scene


@guarded
def compare(
    scenes: Annotated[
        list[Path], typer.Argument(metavar="SCENE...", help="Scenes: .yaml or .json.")
    ],
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder for results.json and report.html.")
    ] = Path("out"),
    spp: Annotated[int | None, typer.Option(help="Samples per pixel of each replicate.")] = None,
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT in pixels.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the first replicate.")] = None,
    replicates: Annotated[
        int, typer.Option(min=2, help="Independent renderings on each side (path tracing).")
    ] = 16,
    threads: Annotated[int | None, typer.Option(min=1, help="Default: all cores.")] = None,
) -> None:
    """Render scenes here and in Mitsuba, and say whether they agree."""
    with compare_extra():
        from comparisons.budget import Budget
        from comparisons.compare import Subject, compare_scene
        from comparisons.provenance import provenance
        from comparisons.report import write_report, write_results
        from comparisons.verdict import exit_code

    console = Console(stderr=True, highlight=False)
    described = [adjusted(Scene.load(path), spp, size, None, seed) for path in scenes]
    for scene in described:
        scene.tables  # files that cannot be used are told before anything takes long  # noqa: B018
    facts = provenance()
    console.print(f"Mitsuba {facts['mitsuba']}", markup=False, soft_wrap=True)
    cases = []
    for path, scene in zip(scenes, described, strict=True):
        start = time.perf_counter()

        def say(step: str, name: str = scene.name) -> None:
            console.print(f"{name}: {step}", markup=False, soft_wrap=True)

        with console.status(scene.name):
            case = compare_scene(
                Subject(scene), Budget(replicates=replicates), say, threads=threads
            )
        case = replace(case, again=_command(path, spp, size, seed, replicates))
        cases.append(case)
        say(f"{case.verdict}: {case.reason} ({time.perf_counter() - start:.0f} s)")
        # Whole after each scene: an interrupted run keeps what it found.
        write_results(out / "results.json", cases, facts)
    write_report(out / "report.html", cases, facts)
    say_where = f"{out / 'results.json'}, {out / 'report.html'}"
    console.print(say_where, markup=False, soft_wrap=True)
    raise typer.Exit(exit_code(cases))


def _command(
    path: Path, spp: int | None, size: str | None, seed: int | None, replicates: int
) -> str:
    """What repeats one case alone."""
    import shlex

    options = {"--spp": spp, "--size": size, "--seed": seed, "--replicates": replicates}
    given = [f"{name} {value}" for name, value in options.items() if value is not None]
    return " ".join(["reference-rt compare", shlex.quote(str(path)), *given])
