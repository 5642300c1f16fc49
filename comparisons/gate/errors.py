"""What can keep the gate from judging at all, each with the exit code that it gives."""

from reference_rt.util.errors import ImageError, ReferenceRtError


class RendererError(ReferenceRtError):
    """The renderer under test hung, crashed, or wrote nothing where it was told to."""

    exit_code = 4


class BaselineMissingError(ReferenceRtError):
    """There is no such baseline, or what it was accepted for has changed since."""

    exit_code = 4


class BaselineEditedError(ImageError):
    """A baseline is not what `accept` wrote."""
