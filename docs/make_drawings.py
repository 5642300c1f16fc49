"""Makes docs/pictures/drawings/: `python docs/make_drawings.py [NAME...]`.

Pages of the course, and those on verdicts, begin with what they are about: rays, shapes, and the
case that goes wrong.  Where rays go is computed, by the scene's own queries or by the page's
formulas.
"""

import sys

import drawn_light as light
import drawn_shapes as shapes
from docs_pages import DOCS
from drawing import Drawing

from reference_rt.util.files import replacing

FOLDER = DOCS / "pictures" / "drawings"

DRAWINGS = {
    draw.__name__: draw
    for draw in (
        *(shapes.rays, shapes.cameras, shapes.rasterising, shapes.sphere, shapes.triangle),
        *(shapes.box_polygon, shapes.quadric, shapes.csg, shapes.precision, shapes.bvh),
        *(light.index, light.shading, light.whitted, light.path, light.light, light.media),
        *(light.derivatives, light.verdict, light.truth, light.gate),
    )
}
"""By the name of the page and of the file."""


def svg(name: str) -> str:
    """The text of a drawing's file."""
    drawing = Drawing()
    DRAWINGS[name](drawing)
    return drawing.svg()


def main() -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[1:] or DRAWINGS:
        with replacing(FOLDER / f"{name}.svg") as temporary:
            temporary.write_text(svg(name), encoding="utf-8")


if __name__ == "__main__":
    main()
