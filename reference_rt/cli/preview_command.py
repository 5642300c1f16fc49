"""`reference-rt preview`, the command; `preview` has what it does."""

from typing import Annotated

import typer

from reference_rt.cli.adjusted import Defaults, SceneArgument, adjusted, by_name, without_blas
from reference_rt.cli.guarded import guarded


@guarded
def preview(
    scene: SceneArgument,
    to: Annotated[
        str,
        typer.Option(
            metavar="PLACE",
            help="window, terminal, sixel, blocks, or a .png file that is rewritten. "
            "(default: a window where there is a display, else SCENE.preview.png)",
        ),
    ] = "",
    spp: Annotated[
        int, typer.Option(min=1, help="Samples per pixel of the finished picture.")
    ] = 4096,
    target_error: Annotated[
        str, typer.Option(help="End at this relative standard error of the picture.")
    ] = "1%",
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT in pixels.")] = None,
    threads: Annotated[int | None, typer.Option(min=1, help="Default: all cores.")] = None,
    define: Defaults = None,
) -> None:
    """Show a picture of a scene that becomes less noisy until it is closed or interrupted."""
    from reference_rt.cli import preview as previews
    from reference_rt.cli.render_options import share_of
    from reference_rt.rendering.scene import Scene

    loaded = adjusted(Scene.load(scene, by_name(define)), size=size)
    view = previews.view_of(to, loaded)
    with without_blas():
        previews.preview(loaded, view, spp, share_of(target_error, "--target-error"), threads)
