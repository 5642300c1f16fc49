"""The gate: another renderer's pictures against our rendering of a scene, or other pictures.

    import comparisons

    case = comparisons.gate(pictures, scene="scenes/cornell_box.yaml")   # a Case, as of `compare`

This package can be called: see `request.gate`.

`pictures_in` reads candidates, `driver` runs a renderer to make them, `request` finds what they are
compared with (`reference`: our rendering or files; `baselines`: accepted pictures), `copies` finds
those that are unchanged, `gate` hands the evidence to the one judge (`comparisons.compare.judge`),
`outputs` writes the `comparisons.results.case.Case`.  `edges` judges the pixels of pictures without
noise; `tone_curves` and `displayed` show our own like theirs.
`rounds` drives a renderer until the question is decided (see `comparisons.compare.looks`).
`pytest_plugin` is the fixture `image_gate`.

Pictures are linear sRGB radiance (height, width, 3) in float64, row 0 on top, premultiplied by
opacity; replicates are (replicates, height, width, 3).  A baseline named "" and a scene None mean
that there is none.  Files from outside are data from strangers: whatever is wrong with one is an
ImageError that names it.

To read another file format, add its first bytes to `pictures_in` and a reader to
`reference_rt.core.image_files`.
"""

import sys
from types import ModuleType
from typing import Any


class _Callable(ModuleType):
    """A package that is called as `request.gate`: `comparisons.gate` is both the name of this
    folder and of what a user wants."""

    def __call__(self, pictures: Any, **settings: Any) -> Any:
        from comparisons.gate.request import gate

        return gate(pictures, **settings)


sys.modules[__name__].__class__ = _Callable
