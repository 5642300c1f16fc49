"""A hypothesis about what is wrong with a picture."""

from dataclasses import dataclass

from comparisons.results.case import FloatArray


@dataclass(frozen=True)
class Hypothesis:
    """family: hypotheses of the same family do not compete;  name, evidence: as in `Cause`;
    picture: the candidate that the hypothesis predicts;  parameters: how many were fitted."""

    family: str
    name: str
    evidence: str
    picture: FloatArray
    parameters: int
