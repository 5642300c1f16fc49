"""F14: a picture depends on its scene and seed alone.

Law: the same bits for any number of threads; any size and order of the bands of pixels; samples
split at any place; rendering stopped anywhere and carried on by another process from what was
kept; any number of rays traced side by side; plain Python instead of compiled kernels.

Ranges: 1 to 16 threads, bands of 1 pixel to the whole picture in shuffled order, 1 to 8 interrupts,
blocks of 8 to 256 rays.  Counts: each pixel is a case, of 48 x 36, in the path-traced scene and the
one by Whitted of F9; in plain Python of 8 x 6.  Passes: every bit is the same.  Mitsuba: the
path-traced scene of 96 x 72 pixels three times with the same seed, its scalar variant with the box
filter, and scalar and llvm with the Gaussian, on 1 to 16 threads against 1.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any

from comparisons.experiments.stability.determinism.parts import bands, blocks, interrupted
from comparisons.experiments.stability.determinism.threads import threads, wide_filter
from comparisons.experiments.stability.harness.family import Family, Series
from comparisons.mitsuba.backend import LLVM, SCALAR

_ONE: Mapping[Any, int] = {"quick": 1, "full": 1}
_UNIT = "largest relative difference"

FAMILY = Family(
    id="F14",
    name="determinism",
    law="a picture has the same bits for any threads, bands, blocks, interrupts, and without "
    "compiled kernels",
    anchors="Lightmetrica's scheduler test asks for similar pictures only",
    series=(
        Series(
            name="threads",
            axis="threads",
            about="Pictures by so many threads against one thread's, with the box filter.",
            values=(1.0, 2.0, 3.0, 4.0, 8.0, 16.0),
            quick=(2.0, 8.0),
            cases=_ONE,
            measure=threads,
            unit=_UNIT,
            explained="the range ends at 16 threads.  Mitsuba's scalar variant has the same bits "
            "with 1 to 8 and not with 16: 11,031 of 20,736 pixels differ, by up to all they are",
        ),
        Series(
            name="wide filter, scalar",
            axis="threads",
            about="The same with the Gaussian filter, Mitsuba's scalar variant.",
            values=(1.0, 2.0, 4.0, 8.0, 16.0),
            quick=(8.0,),
            cases=_ONE,
            measure=partial(wide_filter, SCALAR),
            unit=_UNIT,
            explained="the range ends at 16 threads.  Mitsuba differs from 2 on: in 100 to 171 of "
            "20,736 pixels by up to 2.3e-7, with 16 in 20,195 by up to 0.94",
        ),
        Series(
            name="wide filter, llvm",
            axis="threads",
            about="The same with the Gaussian filter, Mitsuba's llvm variant.",
            values=(1.0, 2.0, 4.0, 8.0, 16.0),
            quick=(8.0,),
            cases=_ONE,
            measure=partial(wide_filter, LLVM),
            unit=_UNIT,
            explained="the range ends at 16 threads.  Mitsuba differs from 2 on: in 1,050 to 6,519 "
            "of 20,736 pixels, by up to 8.8e-7",
        ),
        Series(
            name="bands",
            axis="pixels in a band",
            about="Bands in any order, the samples of each cut in two anywhere.",
            values=(1.0, 7.0, 64.0, 1000.0, 1728.0),
            quick=(7.0, 1000.0),
            cases=_ONE,
            measure=bands,
            unit=_UNIT,
        ),
        Series(
            name="interrupted",
            axis="interrupts",
            about="Parts of a picture by processes one after another, each from the file that the "
            "one before has left.",
            values=(1.0, 3.0, 8.0),
            quick=(1.0,),
            cases=_ONE,
            measure=interrupted,
            unit=_UNIT,
        ),
        Series(
            name="blocks in plain Python",
            axis="rays side by side",
            about="Tiny pictures without compiled kernels, so many rays at a time, against "
            "compiled ones with 64.",
            values=(8.0, 16.0, 64.0, 256.0),
            quick=(8.0,),
            cases=_ONE,
            measure=blocks,
            unit=_UNIT,
        ),
    ),
)
