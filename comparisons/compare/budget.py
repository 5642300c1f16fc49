"""How much work one comparison may take: samples, replicates, rays, and the bias to detect."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from comparisons.compare.looks import FIRST, PARTS, PATIENCE, SECONDS
from comparisons.renderers import ReferenceSampler, WitnessName, several
from comparisons.results.differentiators import DifferentiatorName, Guiding
from reference_rt.cli.quantities import seconds_in
from reference_rt.core.model import Description


def _read(value: Any) -> Any:
    return seconds_in(value) if isinstance(value, str) else value


Seconds = Annotated[float, BeforeValidator(_read), Field(gt=0)]
"""A duration: a number of seconds, or a text such as 10m."""

PixelSize = tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]]


LEAST = 4
"""Samples per pixel: of fewer a pixel takes few values, unlike the noise that tests know best."""


SMALL = 1 << 18
"""Samples of a picture below which a start of both renderers costs as much as a good part of them:
about 0.1 s, and 1.4 us for a sample of both (Cornell box, CPU time, two-core Intel Xeon)."""


def part_of(spp: int, parts: int, pixels: int) -> int:
    """Samples per pixel of a replicate that has a part in `parts` of a scene's; of a small picture
    up to twice as many; at least LEAST."""
    part = spp // parts
    if parts > 1:
        part = max(part, min(2 * part, SMALL // pixels))
    return max(min(LEAST, spp), part)


class Asked(Description):
    """A derivative that is asked for in place of a picture."""

    parameter: str
    """Its path in the scene (`reference_rt.scene.parameters`)."""
    integrator: DifferentiatorName = "prb"
    """Mitsuba's."""
    guiding: Guiding | None = None
    """Of integrators that sample edges; None: Mitsuba's own choice."""
    step: Annotated[float, Field(gt=0)] | None = None
    """Of our differences, in the parameter's unit; None: of its scale."""


class Budget(Description):
    """The work of one comparison of a scene, and the bias that it must be able to detect."""

    spp: Annotated[int, Field(ge=1)] | None = None
    """Samples per pixel of each replicate; None: the scene's own, or a part of them."""
    reference_spp: Annotated[int, Field(ge=1)] | None = None
    """Samples per pixel of Mitsuba's replicates; None: as many as ours.  Independent ones are
    cheaper and noisier than ours: with more of them the difference has the least noise."""
    reference_sampler: ReferenceSampler = "independent"
    """How Mitsuba draws the samples of a pixel.  `multijitter` stratifies them: on the Cornell box
    16 have the noise of 64 independent ones.  Pixels and replicates stay independent of each other,
    which is what the statistics need.  Suites keep `independent`, for which their budgets were
    measured."""
    parts: Annotated[int, Field(ge=1)] = 1
    """Without `spp`: each replicate has this part of the scene's own samples, see `part_of`."""
    size: Annotated[PixelSize, Field(strict=False)] | None = None
    """Width and height in pixels; None: the scene's own."""
    replicates: Annotated[int, Field(ge=2)] = 16
    """Independent pictures by each renderer; with `seconds`, those of the first look."""
    most_first: Annotated[int, Field(ge=2)] | None = None
    """With `seconds`: the first look waits until the noise permits a decision, up to so many
    replicates; None: it does not wait."""
    seconds: Seconds | None = None
    """None: exactly `replicates`.  Otherwise others are added, as many as the noise asks for, until
    the statistics are decided, or until this time has passed since the first one was begun (see
    `comparisons.compare.looks`).
    Suites have fixed replicates: their budgets are chosen from the measured noise, their run time
    is known, and their results depend on no clock."""
    pixels: Annotated[int, Field(ge=16)] = 16_700
    """Camera rays of the Whitted rung, and of the geometry rung, which traces six times as many
    rays in total."""
    light_pixels: Annotated[int, Field(ge=16)] = 1024
    """Camera rays of the rung of direct light."""
    resolution: bool = True
    """Whether it is measured how many secondary rays hit the wrong surface in Mitsuba
    (`comparisons.rungs.rays.resolution`).  Without it such a scene is `differ` in place of
    `reference-limited`."""
    limit: Annotated[float, Field(gt=0)] = 0.005
    """The smallest relative bias of the image mean that must be detectable."""
    witness: Annotated[tuple[WitnessName, ...], BeforeValidator(several)] = ()
    """Other renderers whose pictures say who stands alone (`comparisons.rungs.witness`)."""
    derivative: Asked | None = None
    """Compare a derivative of the picture in place of the picture."""
    control: bool = False
    """Compare Mitsuba with itself (another variant, other seeds) instead of ours with Mitsuba."""


def usual(
    spp: int | None = None,
    replicates: int | None = None,
    seconds: float = SECONDS,
    *,
    fixed: bool = False,
    **more: Any,
) -> Budget:
    """That of a comparison of one's own, as `reference-rt compare` makes it: what is not given is
    found from the noise.

    spp: samples per pixel of each replicate, which the scene has already; None: a part of the
    scene's;  replicates: of the first look;  fixed: exactly so many;  more: other fields.
    """
    more = {"reference_sampler": "multijitter", **more}
    if fixed:
        return Budget(replicates=replicates or Budget().replicates, **more)
    if replicates is not None:
        return Budget(replicates=replicates, seconds=seconds, **more)
    if spp is not None:
        return Budget(replicates=FIRST, seconds=seconds, **more)
    waits = PATIENCE * FIRST
    return Budget(replicates=FIRST, most_first=waits, parts=PARTS, seconds=seconds, **more)
