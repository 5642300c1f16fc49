"""Statistical tests of noisy pictures: the means of independent replicates on both sides.

Each side renders the scene R times with independent seeds. The means are compared, with the
variance of either side (Welch 1947), at several scales (`scales.SCALES`): of the image, of tiles,
pixels, rows and columns, and smooth patterns. Each scale is a family of tests that share one level
(Šidák 1967), and so are the ranks of the differences of small blocks among differences that hold
only noise (`ranks`); the levels of all families add up to one false alarm in a thousand cases.

Each mean has three standard errors, and a bias is proven only if it is so with each. One comes from
the spread of the means between replicates, whatever happens inside a picture (correlated pixels,
stratification, a filter); it has about 2 (R - 1) degrees of freedom. The other comes from the
pixels inside the cell (for a pixel: from its neighbours), as if they were independent; it has
thousands. It protects against few replicates that agree by chance, whose spread is too small. The
third adds the noise of light that few replicates met, and that a cell may have missed (`rare`).

The rule is one of equivalence: the absence of a proven difference is not yet agreement.

- `differ`: a bias larger than the margin is proven, that is, a confidence interval lies wholly
  outside ± the margin of its scale (`Margins`); or the ranks are too low.
- `invalid`: the ranks are too high: the two sides share their noise.
- `agree`: nothing differs, each channel's interval of the image mean lies wholly inside ± the
  limit, the smallest bias that such a run detects with 99 % power is at most the limit, and no more
  than the limit may be missing of the light that few replicates met.
- `inconclusive`: none of these; the reason says how many times more samples are needed.

The least standard error is the rounding of float32: no side counts as free of noise. Pixels without
noise, or with hardly any, may differ by the rounding of half floats (`Margins.stored`).

Heavy tails. If noise is lognormal, or few fireflies carry much of the energy, the sample variance
of replicates is unreliable, and Student's t fails. Four rules keep the level:

- Both standard errors are used: a firefly in one pixel or one replicate widens the interval.
- The degrees of freedom of the second one follow from the kurtosis of the pixels (Box 1953); they
  fall to about the number of fireflies seen.
- The side with fewer replicates counts as at least as noisy as the other: it has seen fewer of the
  rare paths.
- A pixel with two possible values may differ without any spread by chance; such pixels count only
  if there are more than chance produces.

With as many replicates on both sides and noise of one distribution the difference is symmetric, and
heavy tails make the tests less sensitive, but not wrong. The ranks assume no distribution at all.
False alarms per case, measured with 2,000 and more cases each: see the slow tests.

Not handled: light that no replicate of a side has met, not in a single pixel. If the other side
samples it, the sides differ, as they do where a lamp is forgotten. If neither has met it, both
agree without it. So the reason says on what it is conditional: it names the number of pixel values,
the share of the energy that one replicate alone met, and how much of such light may be missing.
Every test needs some such assumption (Bahadur and Savage 1956).

A run may look at its replicates several times while their number grows: each look uses a share of
every level (`compare`, `level`), and the shares sum to 1 at most (`comparisons.compare.looks`).

Contract: pictures are linear radiance, (R, height, width, 3) or (height, width, 3); biases, limits
and margins are fractions of the reference's mean. `compare` returns the `statistics` rung. A side
of a single picture is handled by `single`; a reference with known mean and variance is `Known`. To
add a scale: its test, and its row in `scales` (the levels must still sum to 1e-3).
"""

from comparisons.statistics.advice import noise_free_candidate, replicates_asked, shortfall
from comparisons.statistics.cells import CHANNELS, PAIRED, Margins
from comparisons.statistics.decide import compare, differences
from comparisons.statistics.places import standard_error, worst_regions
from comparisons.statistics.reading import read
from comparisons.statistics.sides import Known

__all__ = [
    "CHANNELS",
    "PAIRED",
    "Known",
    "Margins",
    "compare",
    "differences",
    "noise_free_candidate",
    "read",
    "replicates_asked",
    "shortfall",
    "standard_error",
    "worst_regions",
]
