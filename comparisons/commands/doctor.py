"""What `reference-rt doctor` says about comparisons."""

import importlib.util
from collections.abc import Iterable
from typing import get_args

from comparisons.mitsuba import backend
from comparisons.renderers import WitnessName, other
from reference_rt.cli.doctor import Check
from reference_rt.util.errors import ReferenceUnavailableError
from reference_rt.util.extras import missing


def checks() -> Iterable[Check]:
    """The variant of Mitsuba that works here, and the packages that comparisons need."""
    try:
        chosen = backend.choose()
    except ReferenceUnavailableError as error:
        yield Check("Mitsuba", "does not work", " ".join(str(error).split()), False)
    else:
        slow = "" if chosen.variant != backend.SCALAR else f"slow: {chosen.reason}"
        advice = "; ".join(filter(None, (chosen.doubt, slow)))
        yield Check("Mitsuba", f"{chosen.version}, {chosen.variant}", advice)
    if importlib.util.find_spec("flip_evaluator") is None:
        yield Check(
            "FLIP", "left out: flip-evaluator is not installed", "pip install flip-evaluator"
        )
    if importlib.util.find_spec("raysect") is None:
        yield Check(
            "raysect", "left out: it is not installed", "pip install 'reference-rt[witness]'"
        )
    for witness in map(other, get_args(WitnessName)):
        try:
            yield Check(witness.title, witness.version())
        except ReferenceUnavailableError as error:
            yield Check(witness.title, "left out", str(error))
    if lacks := missing("compare"):
        found = f"without {', '.join(lacks)}"
        yield Check("comparisons", found, "pip install 'reference-rt[compare]'", False)
