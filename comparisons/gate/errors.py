"""Errors after which the gate has no verdict, with their exit codes."""

from reference_rt.util.errors import ImageError, ReferenceRtError


class RendererError(ReferenceRtError):
    """The renderer under test hung, crashed, or did not write the requested file."""

    exit_code = 4


class BaselineMissingError(ReferenceRtError):
    """There is no such baseline, or its scene has changed since it was accepted."""

    exit_code = 4


class BaselineEditedError(ImageError):
    """A baseline's files have changed since `accept` wrote them."""
