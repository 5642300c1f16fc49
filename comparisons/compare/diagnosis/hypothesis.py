"""What may be wrong with a picture."""

from dataclasses import dataclass

from comparisons.results.case import FloatArray


@dataclass(frozen=True)
class Hypothesis:
    """family: hypotheses of one do not compete;  name, evidence: as in `Cause`;  picture: what the
    candidate would be;  parameters: how many were fitted to make it so."""

    family: str
    name: str
    evidence: str
    picture: FloatArray
    parameters: int
