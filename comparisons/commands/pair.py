"""`gate --pair`: whether two renderers, builds, back ends or versions are the same renderer."""

import shlex
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from comparisons.commands.options import compare_extra
from reference_rt.cli.guarded import say
from reference_rt.util.errors import ReferenceRtError, UsageError, printable

if TYPE_CHECKING:
    from comparisons.gate.driver import Command
    from reference_rt.rendering.scene import Scene

_SUFFIXES = (".exr", ".png", ".pfm", ".hdr", ".npy")


def pair_gate(
    pair: tuple[str, str],
    described: "Scene | None",
    scene: Path | None,
    *,
    judged: bool,
    layer: str,
    spp: int | None,
    seed: int | None,
    replicates: int | None,
    fixed: bool,
    seconds: float | None,
    suffix: str | None,
    limit: float,
    noise_free: bool,
    rim: int,
    out: Path,
    threads: int | None,
    junit: Path | None,
    github: bool,
    trace: str,
) -> None:
    """Judge two sides, each a command, a web page, or pictures in a folder or a file."""
    started = time.perf_counter()
    with compare_extra("the gate"):
        from comparisons.commands.outputs import Outputs
        from comparisons.compare.looks import SECONDS
        from comparisons.gate import outputs
        from comparisons.gate.driver import Driver
        from comparisons.gate.gate import not_run
        from comparisons.gate.pair import SIDES, Asked, driven_pair, pair_case
        from comparisons.gate.pictures_in import read_candidates
        from comparisons.gate.reference import is_noise_free
        from comparisons.gate.rounds import Rounds
        from comparisons.report import biases, terminal
        from comparisons.report.ci import Formats
        from comparisons.results.headline import headline
        from comparisons.results.naming import named
        from comparisons.translator.resolved import write_resolved
    from reference_rt.util.console import ProgressLine

    still = noise_free or (described is not None and is_noise_free(described))
    if described is not None and not still:
        spp = getattr(described.resolved_sampler, "spp", spp)
    folders = [out / "candidates" / name for name in ("A", "B")]
    film = None if described is None else (described.film.width, described.film.height)
    more: dict[str, Any] = {"spp": spp, "size": film, "seconds": seconds or SECONDS}
    data = None if scene is None else out / "candidates" / "scene.json"
    sides = [_side(text, scene, data, suffix, more) for text in pair]
    commands = [side for side in sides if not isinstance(side, list)]
    if len(commands) == 1:
        raise UsageError("--pair: expected two commands or pages, or pictures of both")
    files = [side for side in sides if isinstance(side, list)]
    if all(Path(text).is_dir() for text in pair):
        files = _matched(pair, files)
    driving = {"seed": seed, "replicates": replicates, "fixed": fixed, "suffix": suffix}
    if not commands and (given := [name for name, value in driving.items() if value]):
        raise UsageError(f"--{given[0]}: only applies to commands and pages, got pictures")
    name = printable("pair" if described is None else described.name)
    asked = Asked(limit, name, described, spp, judged, still, rim, threads)
    for_ci = Formats(junit, github)
    kept = ("candidates",) if commands else ()
    Outputs(out, ("results.json", "report.html"), kept, others=for_ci.files).prepare()
    drivers: list[Driver] = []
    failed: ReferenceRtError | None = None
    try:
        with ProgressLine() as progress:
            if commands:
                if data is not None and described is not None:
                    write_resolved(described, data, float32=True)
                for command, keep in zip(commands, folders, strict=True):
                    tell = partial(_tell, progress.line, keep.name)
                    drivers.append(Driver(command, keep, tell))
                first = Rounds() if seed is None else Rounds(seed)
                rounds = replace(
                    first,
                    replicates=replicates or first.replicates,
                    seconds=None if fixed else seconds or SECONDS,
                )
                case = driven_pair(asked, (drivers[0], drivers[1]), rounds, progress.line)
            else:
                one, two = ([p for f in side for p in read_candidates(f, layer)] for side in files)
                case = pair_case(one, two, asked)
                if [f.resolve() for f in files[0]] == [f.resolve() for f in files[1]]:
                    case = replace(case, notes=(*case.notes, "A and B are the same files"))
    except UsageError as error:
        raise UsageError(str(error).replace("--command", "--pair")) from None
    except ReferenceRtError as error:
        failed = error
        case = replace(not_run(name, error), sides=SIDES)
    else:
        times = zip(("candidate", "reference"), drivers, strict=False)
        case = replace(case, seconds={side: {"render": d.seconds} for side, d in times})
    case = replace(case, again=shlex.join(["reference-rt", *sys.argv[1:]]), trace=trace)
    facts = {"limit": limit, "A": pair[0], "B": pair[1]}
    results, report = outputs.write(case, out, facts, time.perf_counter() - started)
    about = {} if scene is None else {case.scene: scene.as_posix()}
    for_ci.write("gate", [case], about, title=f"gate: {case.scene}")
    if failed is not None:
        raise failed
    say(f"{case.scene}: {case.verdict}: {named(headline(case), SIDES)}")
    if case.cause is not None:
        say(f"  {case.cause.name}: {named(case.cause.evidence, SIDES)}")
    for line in (*case.notes, *_places(case.worst), *_voted(case.rungs)):
        say(f"  {line}")
    biases.tell(terminal.console(), case)
    say(f"{results}, {report}", err=True)
    raise typer.Exit(outputs.code_of(case))


def _tell(say: Callable[[str], None], side: str, line: str) -> None:
    say(f"{side}: {line}")


def _places(worst: Sequence[Any]) -> list[str]:
    return [f"at x {p.x}, y {p.y}, {p.width} x {p.height} pixels: {p.what}" for p in worst[:1]]


def _voted(rungs: Sequence[Any]) -> list[str]:
    return [f"judge: {rung.reason}" for rung in rungs if rung.name == "witness"]


def _side(
    text: str,
    scene: Path | None,
    data: Path | None,
    suffix: str | None,
    more: dict[str, Any],
) -> "Command | list[Path]":
    """What one side is: what makes its pictures, or their files.  data: where a web page finds the
    scene;  more: of a command.  Raises UsageError."""
    from comparisons.gate.driver import Command

    path, page = Path(text), Path(text.partition("?")[0])
    if path.is_dir():
        files = sorted(p for p in path.iterdir() if p.suffix.lower() in _SUFFIXES)
        files = [file for file in files if not file.name.startswith(".")]
        if not files:
            raise UsageError(f"--pair: {path} has no pictures; expected {', '.join(_SUFFIXES)}")
        return files
    if path.suffix.lower() in _SUFFIXES:
        return [path]
    if page.suffix.lower() in (".html", ".htm"):
        return Command.of_page(text, scene=data, suffix=suffix or ".npy", **more)
    return Command(text, scene, suffix=suffix or ".exr", **more)


def _matched(folders: tuple[str, str], files: Sequence[list[Path]]) -> list[list[Path]]:
    """The files of both folders, those of one name at the same place; without their suffixes, if
    formats differ.  Raises UsageError for a name that only one of them has."""
    names = [{path.name: path for path in side} for side in files]
    stems = [{path.stem: path for path in side} for side in files]
    is_clear = all(len(by_stem) == len(side) for by_stem, side in zip(stems, files, strict=True))
    one, two = stems if is_clear and stems[0].keys() == stems[1].keys() else names
    lacking = [
        f"{folder} has no {', '.join(missing[:MOST_NAMED])}{', ...' * (len(missing) > MOST_NAMED)}"
        for folder, missing in (
            (folders[0], sorted(two.keys() - one.keys())),
            (folders[1], sorted(one.keys() - two.keys())),
        )
        if missing
    ]
    if lacking:
        raise UsageError(f"--pair: {'; '.join(lacking)}; expected pictures of the same names")
    return [[one[name] for name in sorted(one)], [two[name] for name in sorted(one)]]


MOST_NAMED = 5
"""Missing pictures of a folder that an error names."""
