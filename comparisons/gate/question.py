"""What is asked of candidates."""

from dataclasses import dataclass

from comparisons.compare.darkness import Darkness
from comparisons.compare.judge import Lights
from comparisons.compare.path_length import Lengths
from comparisons.results import LIMIT
from comparisons.results.case import RungResult
from comparisons.rungs.edges import Edges
from comparisons.rungs.witness import Witness


@dataclass(frozen=True)
class Question:
    """What is asked of candidates, and what helps to answer.

    limit: the smallest relative bias of the image mean that must be detectable;  name: the case's;
    lights, lengths: for the diagnosis of a difference;  edges: for pictures without noise;
    witness: a third renderer, where there is no rim;  rim: how many of the outermost pixels are
    left out on each side;  darkness: why pictures of the scene may be black, None where it is not
    known;  misread: what our reference has otherwise than the scene's text, None where nothing.
    """

    limit: float = LIMIT
    name: str = "candidate"
    lights: Lights | None = None
    lengths: Lengths | None = None
    edges: Edges | None = None
    witness: Witness | None = None
    rim: int = 0
    darkness: Darkness | None = None
    misread: RungResult | None = None


USUAL = Question()
"""Without help, of whole pictures."""
