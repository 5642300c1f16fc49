"""`reference-rt derivative`: the derivative of a picture by a parameter, in files and in numbers;
`explain --parameters`: which parameters there are."""

import json
import math
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

from reference_rt.rendering.derivative import Derivative
from reference_rt.rendering.derivative import derivative as differentiated
from reference_rt.rendering.scene import Scene
from reference_rt.scene.parameters import Parameter, parameters
from reference_rt.util.console import ProgressLine


def derivative(
    scene: Scene, parameter: str, output: Path | None, threads: int | None, step: float | None
) -> Derivative:
    """Compute it, and write the file.  Raises UsageError, SceneError, ImageError."""
    with ProgressLine() as progress:
        found = differentiated(scene, parameter, threads=threads, step=step, progress=progress)
    if output is not None:
        found.save(output)
    return found


def numbers_of(found: Derivative) -> dict[str, Any]:
    """What is printed of it.  mean, standard_error, truncation: of the whole picture, by channel;
    standard_error is null where there is one replicate."""
    of = found.replicates.mean(axis=(1, 2))
    error = of.std(axis=0, ddof=1) / math.sqrt(len(of)) if len(of) > 1 else None
    return {
        "parameter": found.parameter,
        "value": found.value,
        "step": found.step,
        "side": found.side,
        "spp": found.spp,
        "replicates": len(of),
        "mean": of.mean(axis=0).tolist(),
        "standard_error": None if error is None else error.tolist(),
        "truncation": found.truncation.mean(axis=(0, 1)).tolist(),
        "seconds": round(found.seconds, 3),
        "warnings": found.warnings,
    }


def as_json(found: Derivative) -> str:
    """One line."""
    return json.dumps(numbers_of(found))


def in_words(found: Derivative, output: Path | None) -> str:
    """The same for people."""
    numbers = numbers_of(found)
    mean, error, truncation = (
        ", ".join(f"{x:.4g}" for x in numbers[name] or (math.inf,))
        for name in ("mean", "standard_error", "truncation")
    )
    side = "" if found.side == "central" else f", {found.side} (the value is at a bound)"
    text = (
        f"by {found.parameter}, step {found.step:g}{side}: mean {mean} ± {error} W/sr/m2 per unit"
    )
    written = "" if output is None else f"{output}: "
    return f"{written}{text}, of which the step makes {truncation}; {found.seconds:.2f} s"


MOST_NUMBERS = 12
"""Numbers of one field that `explain --parameters` prints; those of a mesh are counted."""


def lines_of(scene: Scene) -> Iterator[str]:
    """Each parameter with its value, as `explain --parameters` prints it."""

    def field(one: Parameter) -> tuple[Any, ...]:
        """The keys up to the last name: numbers below are one field's."""
        keys = one.keys
        while isinstance(keys[-1], int):
            keys = keys[:-1]
        return keys

    for _, group in groupby(parameters(scene), field):
        left = 0
        for k, one in enumerate(group):
            if k < MOST_NUMBERS:
                value = f"{one.value:g}" if isinstance(one.value, float) else str([*one.value])
                yield f"{one.path} = {value}"
            else:
                left += 1
        if left:
            yield f"  and {left:,} more numbers of it"
