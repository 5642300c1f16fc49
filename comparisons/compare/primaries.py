"""Matrices between linear colours of different primaries and whites."""

import numpy as np

from comparisons.results.case import FloatArray

SRGB = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06), (0.3127, 0.3290))
"""CIE x, y of red, green, blue and white of sRGB and Rec. 709 (ITU-R BT.709)."""

SPACES = {
    "Rec. 2020": ((0.708, 0.292), (0.170, 0.797), (0.131, 0.046), (0.3127, 0.3290)),
    "Display P3": ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060), (0.3127, 0.3290)),
    "Adobe RGB": ((0.64, 0.33), (0.21, 0.71), (0.15, 0.06), (0.3127, 0.3290)),
    "ACEScg": ((0.713, 0.293), (0.165, 0.830), (0.128, 0.044), (0.32168, 0.33767)),
    "ACES2065-1": ((0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.077), (0.32168, 0.33767)),
}
"""ITU-R BT.2020, SMPTE RP 431-2 with D65, Adobe RGB (1998), SMPTE ST 2065-1 and S-2014-004."""

BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)
"""From XYZ to the responses of cones, for the adaptation to another white (Lam 1985)."""

Chromaticities = tuple[tuple[float, float], ...]


def to_xyz(space: Chromaticities) -> FloatArray:
    """(3, 3): from linear RGB of these primaries and white, whose Y is 1, to CIE XYZ.  Raises
    ValueError where they span no space."""
    if any(y == 0.0 for _, y in space):
        raise ValueError("a primary has y = 0")
    primaries = np.array([[x / y, 1.0, (1.0 - x - y) / y] for x, y in space]).T
    try:
        amounts = np.linalg.solve(primaries[:, :3], primaries[:, 3])
    except np.linalg.LinAlgError:
        raise ValueError("the primaries are on a line") from None
    return np.asarray(primaries[:, :3] * amounts)


def conversion(one: Chromaticities, other: Chromaticities, adapted: bool = True) -> FloatArray:
    """(3, 3): from linear RGB of one space to that of another; white becomes white if `adapted`.
    Raises ValueError as `to_xyz` does."""
    a, b = to_xyz(one), to_xyz(other)
    turned = np.eye(3)
    if adapted:
        whites = [BRADFORD @ (space @ np.ones(3)) for space in (a, b)]
        turned = np.linalg.inv(BRADFORD) @ np.diag(whites[1] / whites[0]) @ BRADFORD
    return np.asarray(np.linalg.inv(b) @ turned @ a)
