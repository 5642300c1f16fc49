"""Tests of means with independent replicates on both sides: the rung for random light transport.

Each side renders the scene R times with independent seeds. What is compared are the means, with the
variance of either side (Welch 1947), at four scales; the level of each family is shared out over
its tests (Šidák 1967), and the levels of all add up to one false alarm in a thousand cases.

- *image*: the mean of each channel; *tiles*: of each channel of each tile; *pixels*: each of them.
- *uniformity*: the ranks of the difference of small blocks among differences that hold only noise.

Two standard errors stand behind each mean, and what is proven must be so with either. One is from
the spread of the means themselves between replicates, whatever happens inside a picture (correlated
pixels, stratification, a filter); it has about 2 (R - 1) degrees of freedom. The other is from
the pixels inside the cell (of a pixel: from its neighbours), as if they were independent; it has
thousands. Few replicates that happen to agree have a spread that is too small, which the latter is
not deceived by.

The rule is one of equivalence: to see no difference is not yet to agree.

- `differ`: a bias larger than the margin is proven, that is, a confidence interval lies wholly
  outside ± the margin of its scale (`Margins`); or the ranks are too low.
- `invalid`: the ranks are too high: the two sides share their noise.
- `agree`: nothing differs, each channel's interval of the image mean lies wholly inside ± the
  limit, and the smallest bias that such a run finds at 99 % power is not larger than the limit.
- `inconclusive`: none of these; the reason says how many times more samples it takes.

No pixel may fail for free, and no side may claim to be without noise: the least standard error is
the rounding of float32. Pixels without noise may differ by `Margins.constant`.

Heavy tails. Where noise is lognormal, or few fireflies carry much of the energy, replicates do not
know their own variance, and Student's law fails. Four things keep the level:
both standard errors are asked, so that a firefly in one pixel or one replicate widens the interval;
the second one has the degrees of freedom of a variance whose kurtosis is that of the pixels (Box
1953), which come down to about the number of fireflies seen; the side with fewer replicates is
reckoned at least as noisy as the other, for it has met less of what is rare; and a pixel of two
values, which may part without any spread, counts only in numbers that tosses of a coin do not make.
With as many replicates on both sides and noise of one law the difference is symmetric, and
heavy tails make the tests less sensitive, not less right. The ranks ask for no law at all.
False alarms per case, measured with 2,000 and more cases each: see the slow tests.

Not handled: energy in paths so rare that no replicate of either side has met one, where the sides
sample it differently. One of them may then be falsely proven different. No test can do without
some such assumption (Bahadur and Savage 1956).

A side of one picture has no replicates: see `single`. A reference of which mean and variance are
known is `Known`.
"""

from comparisons.statistics.decide import compare
from comparisons.statistics.places import standard_error, worst_places
from comparisons.statistics.scales import Margins
from comparisons.statistics.sides import Known

__all__ = ["Known", "Margins", "compare", "standard_error", "worst_places"]
