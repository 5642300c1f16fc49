"""The series of F14; the folder's docstring states the law."""

from functools import partial

from comparisons.experiments.stability.determinism.parts import bands, blocks, interrupted
from comparisons.experiments.stability.determinism.threads import threads, wide_filter
from comparisons.experiments.stability.harness.family import Family, Series, Sweep
from comparisons.mitsuba.backend import LLVM, SCALAR

_ONE = 1, 1

_series = partial(Series, unit="largest relative difference")

FAMILY = Family(
    id="F14",
    name="determinism",
    law="a picture has the same bits for any threads, bands, blocks, interrupts, and without "
    "compiled kernels",
    anchors="Lightmetrica's scheduler test asks for similar pictures only",
    series=(
        _series(
            "threads",
            Sweep("threads", (1.0, 2.0, 3.0, 4.0, 8.0, 16.0), (2.0, 8.0), *_ONE),
            "Pictures by so many threads against one thread's, with the box filter.",
            threads,
            explained="the range ends at 16 threads.  Mitsuba's scalar variant has the same bits "
            "with 1 to 8 and not with 16: 11,031 of 20,736 pixels differ, by up to all they are",
        ),
        _series(
            "wide filter, scalar",
            Sweep("threads", (1.0, 2.0, 4.0, 8.0, 16.0), (8.0,), *_ONE),
            "The same with the Gaussian filter, Mitsuba's scalar variant.",
            partial(wide_filter, SCALAR),
            explained="the range ends at 16 threads.  Mitsuba differs from 2 on: in 100 to 171 of "
            "20,736 pixels by up to 2.3e-7, with 16 in 20,195 by up to 0.94",
        ),
        _series(
            "wide filter, llvm",
            Sweep("threads", (1.0, 2.0, 4.0, 8.0, 16.0), (8.0,), *_ONE),
            "The same with the Gaussian filter, Mitsuba's llvm variant.",
            partial(wide_filter, LLVM),
            explained="the range ends at 16 threads.  Mitsuba differs from 2 on: in 1,050 to 6,519 "
            "of 20,736 pixels, by up to 8.8e-7",
        ),
        _series(
            "bands",
            Sweep("pixels in a band", (1.0, 7.0, 64.0, 1000.0, 1728.0), (7.0, 1000.0), *_ONE),
            "Bands in any order, the samples of each cut in two anywhere.",
            bands,
        ),
        _series(
            "interrupted",
            Sweep("interrupts", (1.0, 3.0, 8.0), (1.0,), *_ONE),
            "Parts of a picture by processes one after another, each from the file that the "
            "one before has left.",
            interrupted,
        ),
        _series(
            "blocks in plain Python",
            Sweep("rays side by side", (8.0, 16.0, 64.0, 256.0), (8.0,), *_ONE),
            "Tiny pictures without compiled kernels, so many rays at a time, against "
            "compiled ones with 64.",
            blocks,
        ),
    ),
)
