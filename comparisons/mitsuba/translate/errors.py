"""The error for parts of a scene that have no counterpart in Mitsuba."""

from typing import Any

from reference_rt.util.errors import ReferenceRtError


class UntranslatableError(ReferenceRtError):
    """A part of a scene has no counterpart in Mitsuba: the scene is `not-comparable`.

    The exit code is the same as if the reference could not run.
    """

    exit_code = 4

    def __init__(self, part: Any, kind: str) -> None:
        name = part if isinstance(part, str) else type(part).__name__
        self.part, self.kind = name, kind
        super().__init__(
            f"the {kind} {name} cannot be compared: comparisons.mitsuba.translate has no "
            "translation for it"
        )
