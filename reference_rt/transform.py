"""Affine transforms: the public face of `reference_rt.core.transform`."""

from reference_rt.core.transform import *  # noqa: F403
