"""Queries of a scene with arrays of rays, points and directions: the public face of
`reference_rt.rendering.query`, whose names it has."""

from reference_rt.rendering.query import *  # noqa: F403
from reference_rt.rendering.query import __all__ as __all__
