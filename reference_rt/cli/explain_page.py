"""The page that `reference-rt explain` prints."""

from collections.abc import Iterable

from rich.console import Console
from rich.table import Table

from reference_rt.cli.explain import explain, margins
from reference_rt.cli.explain_kernels import kernels_of
from reference_rt.rendering.scene import Scene
from reference_rt.scene.likely_mistakes import likely_mistakes
from reference_rt.util.errors import printable


def print_page(scene: Scene) -> None:
    """Print, on standard output, all that is known of a scene without rendering it.  Raises
    SceneError."""
    used, pruned = explain(scene, scene.tables)
    near, beyond = margins(scene)
    mistakes = [
        (str(scene.error("", *mistake.path)), mistake.message)
        for mistake in likely_mistakes(scene, scene.tables)
    ]
    console = Console()
    for title, lines in (
        ("used", used),
        ("specialised away", _by_reason(pruned)),
        ("kernels", kernels_of(scene)),
        ("nearest to float64's limits", near),
        ("warning: beyond float64", beyond),
        ("warning: probably a mistake", mistakes),
    ):
        if not lines:
            continue
        table = Table(title=title, title_justify="left", show_header=False, box=None)
        for what, why in lines:
            table.add_row(printable(what), printable(why))
        console.print(table)
        console.print()


def _by_reason(lines: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """The same with one line for each reason: a simple scene lacks thirty things for ten."""
    names: dict[str, list[str]] = {}
    for what, why in lines:
        names.setdefault(why, []).append(what)
    return [(", ".join(some), why) for why, some in names.items()]
