"""Deprecated: this is now `reference_rt.textbook`, whose names it has."""

import warnings

from reference_rt.textbook import *  # noqa: F403
from reference_rt.textbook import __all__ as __all__

warnings.warn("reference_rt.methods is now reference_rt.textbook", DeprecationWarning, stacklevel=2)
