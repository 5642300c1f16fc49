"""F6: whatever a scene, a file or a ray holds, the answer is defined.

Law.  Each hostile scene gives either one line of error (our classes; exit code 3; the file, the
place in it and what was expected or is malformed), or a picture of which every pixel that is not
finite is reported (exit code 3 too, with the places).  Never a crash, a traceback ("internal
error"), a hang (5 s of computing; 120 s in plain Python) or a pixel that is not finite and not
reported.  Each hostile ray gives a miss or a hit that is finite throughout.

Range.  `damage.NUMBERS` and its neighbours: NaN, infinities, zeros of both signs, the smallest and
largest floats, what overflows when it is squared, integers beyond 64 bits, texts, names of files
that are none, values of other types, sets of each other, cycles, anchors, tags.

Counts.  11,000 scenes and files in the full run (values 4500, structure 1600, grammar 1600, text
480, meshes 2400, images 600), rays 10^5 per magnitude.

Passes.  No failure.

How.  Scenes go to child processes (`worker`), which do as
`reference-rt render` does (8 x 8 pixels, one sample), so that one that dies takes no other with it.
Values change in a few fixed scenes (`bases`), whose compiled kernels stay the same; where they do
not, and where the structure changes (`damage`), plain Python runs the same code
(NUMBA_DISABLE_JIT=1), bit-identical and without seconds of compiling.

To reproduce a failure: its scene is in the examples as text, or else the file's bytes in base 64;
`reference-rt render scene.json -o out.exr --size 8x8 --spp 1`.

`files` and `rays` have the cases; `damage` makes them of `bases`."""

from comparisons.experiments.stability.harness.series import Family
from comparisons.experiments.stability.hostile import files, rays

__all__ = ["files", "rays"]

FAMILY = Family(
    "F6",
    "hostile values",
    "A hostile scene, file or ray gives one clear line of error or a defined answer, in which what "
    "is not finite is reported: no crash, no hang, no traceback.",
    "Embree's tests trace NaN and infinite rays and limit their time to 2.5 times that of ordinary "
    "ones; no renderer publishes a test of hostile scenes.",
)
