"""`reference-rt truth`, and `reference-rt gate --truth`."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from comparisons.commands.options import Threads, compare_extra, out_folder, table_in
from reference_rt.cli.guarded import guarded, say
from reference_rt.util.errors import UsageError

if TYPE_CHECKING:
    from comparisons.truth.case import Case
    from comparisons.truth.outputs import Row

SCENES = Path("scenes/truth")

BOTH = (("both", "ours"), ("both", "mitsuba"))


@guarded
def truth(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]...",
            help="Cases, areas such as materials, or patterns such as 'glass_*'. (default: all)",
        ),
    ] = None,
    out: Annotated[Path, out_folder("results, the page and the badge", "DIR")] = Path("out/truth"),
    renderer: Annotated[
        str, typer.Option(metavar="NAME", help="ours, mitsuba, both, cycles or povray.")
    ] = "both",
    scenes: Annotated[
        Path, typer.Option(metavar="DIR", help="The folder of the scene files.")
    ] = SCENES,
    replicates: Annotated[
        int | None, typer.Option(min=1, help="Pictures of each case. (default: 4)")
    ] = None,
    spp: Annotated[
        int | None, typer.Option(min=1, help="Samples per pixel. (default: the scene's)")
    ] = None,
    threads: Threads = None,
    derivatives: Annotated[
        bool,
        typer.Option(
            "--derivatives", help="Judge derivatives by a parameter in place of pictures."
        ),
    ] = False,
    markdown: Annotated[Path | None, table_in("truth")] = None,
) -> None:
    """Render scenes whose pixels are known by formula, by ours and by Mitsuba.

    Mitsuba's faults do not fail the run unless it is the only renderer.

    Exit codes: 0: all are right; 1: one is off, or too noisy; 2: wrong usage; 3: a scene is
    invalid; 4: Mitsuba is missing.
    """
    with compare_extra("truth"):
        from comparisons.commands.outputs import Outputs
        from comparisons.mitsuba.backend import SCALAR
        from comparisons.renderers import other
        from comparisons.report import terminal
        from comparisons.runs.provenance import ours, provenance
        from comparisons.truth import outputs
        from comparisons.truth import renderers as by
        from comparisons.truth.case import Derivative
    from reference_rt.util.console import ProgressLine

    if derivatives:
        if replicates is not None or spp is not None:
            raise UsageError("--derivatives: each case has its own samples; expected no --spp")
        if renderer != "both" and renderer not in by.DIFFERENTIATED:
            known = ", ".join(by.DIFFERENTIATED)
            raise UsageError(f"--renderer: expected {known} of derivatives, got '{renderer}'")
    if renderer not in (*by.RENDERERS, "both"):
        expected = "ours, mitsuba, both, cycles or povray"
        raise UsageError(f"--renderer: expected {expected}, got '{renderer}'")
    picked = _chosen(names or (), derivatives=derivatives)
    who = [each for each in by.RENDERERS if renderer == each or (renderer, each) in BOTH]
    if derivatives:
        who = [each for each in who if each in by.DIFFERENTIATED]
    table = "truth derivatives" if derivatives else "truth"
    writes = Outputs(out, ("results.json", "report.html"), markdown=(markdown, table))
    writes.prepare()
    begun = time.perf_counter()
    facts = provenance() if "mitsuba" in who else ours()
    facts |= {name: other(name).version() for name in who if name not in ("ours", "mitsuba")}
    rows: list[Row] = []
    with ProgressLine() as progress:
        for k, case in enumerate(picked):
            progress("cases", k / len(picked))
            progress.note(case.name)
            if isinstance(case, Derivative):
                scene = by.load(scenes / f"{case.of.name}.yaml")
                chosen = {each: by.DIFFERENTIATED[each] for each in who}
                rows += by.derivative_rows(case, scene, chosen, threads)
                continue
            scene = by.load(scenes / f"{case.name}.yaml", spp)
            rows += by.row_of(case, scene, who, replicates or by.REPLICATES, threads)
        progress("cases", 1.0)
    facts |= {"variant": SCALAR} if "mitsuba" in who else {}
    facts |= {"seconds": round(time.perf_counter() - begun, 1)}
    outputs.write(out, rows, facts)
    outputs.show(terminal.console(), rows)
    writes.finish(lambda: outputs.markdown(rows, facts))
    counted = [row for row in rows if row.renderer == who[0]]
    raise typer.Exit(outputs.exit_code(counted))


def truth_gate(
    name: str,
    candidates: Sequence[Path],
    command: str | None,
    layer: str,
    out: Path,
    **driving: Any,
) -> None:
    """`gate --truth NAME`: pictures, or those that `command` makes, against the formula.

    driving: fields of `comparisons.truth.renderers.Driven`, None for its own.
    """
    with compare_extra("truth"):
        from comparisons.commands.outputs import Outputs
        from comparisons.gate.pictures_in import read_candidates
        from comparisons.report import terminal
        from comparisons.runs.provenance import ours
        from comparisons.truth import outputs
        from comparisons.truth.renderers import Driven, judged

    picked = _chosen([name], "--truth: ")
    if command is None and len(picked) > 1:
        raise UsageError(f"--truth: '{name}' is {len(picked)} cases; expected one, or --command")
    writes = Outputs(out, ("results.json", "report.html"))
    writes.prepare()
    facts: dict[str, Any] = ours()
    if command is None:
        facts["candidates"] = [str(path) for path in candidates]
        pictures = [p for path in candidates for p in read_candidates(path, layer)]
        rows = [judged(picked[0], pictures)]
    else:
        facts["command"] = command
        given = {key: value for key, value in driving.items() if value is not None}
        driven = Driven(command, SCENES, out / "candidates", **given)
        rows = [driven.row(case, lambda line: say(line, err=True)) for case in picked]
    outputs.write(out, rows, facts)
    outputs.show(terminal.console(), rows)
    writes.finish()
    raise typer.Exit(outputs.exit_code(rows))


def _chosen(names: Sequence[str], option: str = "", derivatives: bool = False) -> "Sequence[Case]":
    from comparisons.truth import case

    try:
        return case.chosen(names, case.derivatives()) if derivatives else case.chosen(names)
    except ValueError as error:
        raise UsageError(f"{option}{error}") from None
