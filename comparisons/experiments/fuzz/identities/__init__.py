"""Changes of a scene that must not change what is seen: no second renderer is needed.

An identity is a function of the `Original` scene.  It returns "agree", None if it does not apply,
or the `Finding`.  To add one: the function, in `same_bits.py` where
rounding is the same in both scenes, else in `rounded.py`; a line below.
"""

from collections.abc import Callable

from comparisons.experiments.fuzz.finding import Finding
from comparisons.experiments.fuzz.identities import rounded, same_bits
from comparisons.experiments.fuzz.identities.rays import Original

Identity = Callable[[Original], str | Finding | None]

IDENTITIES: dict[str, Identity] = {
    "written": same_bits.written,
    "renamed": same_bits.renamed,
    "threads": same_bits.threads,
    "hierarchy": same_bits.hierarchy,
    "reordered": same_bits.reordered,
    "split": same_bits.split,
    "scaled": same_bits.scaled,
    "moved": rounded.moved,
    "grouped": rounded.grouped,
}
"""By name, in the order in which a scene is put through them."""

__all__ = ["IDENTITIES", "Identity", "Original"]
