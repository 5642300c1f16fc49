"""What Mitsuba lacks, written with its own parts.

The classes derive from classes of a variant, so they are made and registered after `set_variant`.
"""

from typing import Any

from comparisons.mitsuba.plugins import exact_beckmann, exact_coat, mixtures, phong, whitted


def register(mi: Any) -> None:
    """Make the plugins of this folder known to `mi.load_dict`, for the variant that is set."""
    for plugin in (exact_beckmann, exact_coat, mixtures, phong, whitted):
        plugin.register(mi)
