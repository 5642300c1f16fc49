"""Limits the size of the page: reduces or omits the float pictures of some cases."""

from collections.abc import Sequence
from dataclasses import dataclass

from comparisons.report.pictures_data import as_json, pack
from comparisons.results.case import Images

COARSEST = 32
"""The largest block, in pixels of each side, that is averaged into one pixel; float pictures that
are still too large are omitted."""

FEWEST_BYTES = 1.0
"""Bytes per packed pixel that nearly all pictures need at least."""


@dataclass(frozen=True)
class Fitted:
    """The float pictures of a case as JSON ("": omitted); means over factor x factor pixels."""

    data: str
    factor: int


def fitted(
    pictures: Sequence[Images | None], failed: Sequence[bool], most_bytes: int
) -> list[Fitted | None]:
    """The pictures of all cases within `most_bytes`; None where a case has none.

    The largest pictures of cases that did not fail are reduced first; those of failed cases only
    when no others are left.
    """
    kept = {i: _packed(p, 1, most_bytes) for i, p in enumerate(pictures) if p is not None}
    while sum(len(one.data) for one in kept.values()) > most_bytes:
        _, _, coarse = max((not failed[i], len(one.data), i) for i, one in kept.items() if one.data)
        images = pictures[coarse]
        assert images is not None
        kept[coarse] = _packed(images, 2 * kept[coarse].factor, most_bytes)
    return [kept.get(i) for i in range(len(pictures))]


def _packed(images: Images, factor: int, most_bytes: int) -> Fitted:
    pixels = images.candidate[..., 0].size + images.reference[..., 0].size
    # Packing takes seconds for a picture that cannot fit anyway.
    while factor <= COARSEST and FEWEST_BYTES * pixels > most_bytes * factor**2:
        factor *= 2
    if factor > COARSEST:
        return Fitted("", factor)
    return Fitted(as_json(pack(images, factor)), factor)
