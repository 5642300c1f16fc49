"""The comparison of one scene with Mitsuba, from measurements to a verdict.

    import comparisons

    case = comparisons.compare("scenes/cornell_box.yaml")   # a Case, with a view in notebooks

This package can be called: see `one_scene.compare_one`.

`compare_scene` runs the deterministic rungs (film, geometry, direct, whitted) in order, renders the
pictures of both sides (`pictures`), and hands the `Evidence` to `judge`, which adds the rungs of
pictures and returns a `comparisons.results.case.Case`.  `looks` adds replicates until the question
is decided, if the budget has a time limit.  `diagnosis`, with `single_lights` and `path_length`,
names the likeliest cause of a difference; `ray_starts` measures whether it is Mitsuba's ray
epsilon in glass, and `precision` whether a limit explains what differs.  `control` compares Mitsuba
with itself: a difference there is a fault of the harness.

A `Budget` says how much work a comparison may take and which relative bias it must detect; None
means the scene's own value.  Pictures are (height, width, 3) float64 linear radiance, replicates
(replicates, height, width, 3); times are wall-clock seconds by side and step.

To add a rung, see `comparisons.rungs`; to add a hypothesis, yield it in `diagnosis.brightness` or
`diagnosis.place`.
"""

import sys
from types import ModuleType
from typing import Any


class _Callable(ModuleType):
    """A package that is called as `one_scene.compare_one`: `comparisons.compare` is both the name
    of this folder and of what a user wants."""

    def __call__(self, scene: Any, **settings: Any) -> Any:
        from comparisons.compare.one_scene import compare_one

        return compare_one(scene, **settings)


sys.modules[__name__].__class__ = _Callable
