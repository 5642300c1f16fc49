"""`reference-rt accept`: the baselines of `gate`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from comparisons.commands.options import Baselines, Layer, NoiseFree, compare_extra
from comparisons.results import LIMIT
from reference_rt.cli.guarded import guarded, say
from reference_rt.cli.options import adjusted
from reference_rt.util.errors import SceneError, UsageError

if TYPE_CHECKING:
    from comparisons.gate.baselines import Record
    from comparisons.results.case import FloatArray


@guarded
def accept(
    candidates: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[CANDIDATE]...", help="Picture files; several are replicates of one picture."
        ),
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the baseline.")] = None,
    reason: Annotated[str | None, typer.Option(help="Why these pictures are right.")] = None,
    scene: Annotated[
        Path | None,
        typer.Option(help="The scene shown; if it changes, the baseline becomes stale."),
    ] = None,
    spp: Annotated[
        int | None, typer.Option(min=1, help="Samples per pixel of the scene, if not its own.")
    ] = None,
    size: Annotated[
        str | None, typer.Option(metavar="WIDTHxHEIGHT", help="The scene's size, if not its own.")
    ] = None,
    limit: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="Warn if no gate could detect this relative bias with so few pictures.",
        ),
    ] = LIMIT,
    baselines: Baselines = Path("baselines"),
    layer: Layer = "",
    noise_free: NoiseFree = False,
    listed: Annotated[
        bool, typer.Option("--list", help="List all baselines, and which are stale.")
    ] = False,
    unused: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="List the baselines that no results.json below DIR names; exit code 1 if any.",
        ),
    ] = None,
) -> None:
    """Accept pictures as a baseline for `gate --baseline`; refused in CI."""
    with compare_extra("accepting"):
        from comparisons.gate import baselines as store
        from comparisons.gate.digest import scene_digest
        from comparisons.gate.pictures_in import read_candidates
        from comparisons.gate.reference import check_sizes, is_noise_free
        from comparisons.runs.provenance import ours
    from reference_rt.rendering.scene import Scene

    if listed or unused is not None:
        if candidates or name:
            raise UsageError("--list and --unused write no baseline; expected no candidates")
        found = store.all_in(baselines)
        used = None if unused is None else store.used_in(unused)
        for one in found:
            if used is None or one.record.name not in used:
                say(_described(one.record, baselines))
        idle = [one for one in found if used is not None and one.record.name not in used]
        raise typer.Exit(1 if idle else 0)
    if scene is None and (spp is not None or size is not None):
        raise UsageError("--spp and --size only apply to --scene; expected that too")
    if not candidates or name is None or reason is None:
        raise UsageError("expected CANDIDATE... with --name and --reason, or --list, or --unused")
    store.refuse_in_ci()
    store.check_place(baselines, name)
    pictures = [p for path in candidates for p in read_candidates(path, layer)]
    of_scene = None
    if scene is not None:
        described = adjusted(Scene.load(scene), spp, size)
        film = described.film
        check_sizes(pictures, f"{film.width} x {film.height}", "the size of the scene")
        of_scene = store.SceneOf(
            file=scene.as_posix(), digest=scene_digest(described), size=size, spp=spp
        )
        noise_free = noise_free or is_noise_free(described)
    facts = ours()
    written = store.accept(
        baselines,
        name,
        reason,
        pictures,
        scene=of_scene,
        noise_free=noise_free,
        facts={key: facts[key] for key in ("reference_rt", "numpy", "numba", "python")},
        machine=facts["machine"],
        date=facts["date"],
    )
    say(f"{written.folder}: accepted; commit it", err=True)
    too_noisy = "" if noise_free else _too_noisy(written.reference().pictures, limit)
    if too_noisy:
        told = f"a limit of {100.0 * limit:g} % cannot be reached with this baseline: {too_noisy}"
        say(f"note: {told}", err=True)
    if len(pictures) == 1 and not noise_free:
        say(
            "note: the noise of a single picture is unknown, which makes the gate less sensitive; "
            "accept several with different seeds, or use --noise-free",
            err=True,
        )


def _too_noisy(pictures: "FloatArray", limit: float) -> str:
    """Why no candidate can be shown to agree within `limit`; "" if one can, or if it is unknown."""
    from comparisons import statistics

    if not limit > statistics.Margins().image:
        return "it is not above the margin of the image mean, 0.1 %"
    alone = statistics.noise_free_candidate(pictures)
    return "" if alone is None else statistics.shortfall(alone, limit)


def _described(record: "Record", folder: Path) -> str:
    """A baseline in one line."""
    from comparisons.gate.baselines import scene_of
    from comparisons.gate.digest import scene_digest

    of = "no scene"
    if record.scene is not None:
        of = record.scene.file
        try:
            scene = scene_of(record, folder)
            if scene is None:
                of += " (not found)"
            elif scene_digest(scene) != record.scene.digest:
                of += " (stale)"
        except SceneError:
            of += " (cannot be read)"
    count = "1 picture" if record.replicates == 1 else f"{record.replicates} pictures"
    size = f"{record.width} x {record.height}"
    return f"{record.name}: {record.date}: {of}: {count} of {size}: {record.reason}"
