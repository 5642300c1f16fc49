"""The slabs of `areas/atmospheres.py` by PythonicDISORT: `python -m comparisons.truth.disort`.

It prints the table of radiances that stands there, with fewer streams and with as many as are used,
whose difference is the error.  PythonicDISORT 1.8 (`pip install PythonicDISORT`; Ho 2024, JOSS 9,
6442) solves the equation of transfer by discrete ordinates (Stamnes and others 1988), and shares
nothing with a path tracer.  Users of the cases do not need it.
"""

import warnings

import numpy as np

from comparisons.truth.areas.atmospheres import SLABS, Slab
from comparisons.truth.case import FloatArray


def radiance(slab: Slab, colour: int, streams: int) -> float:
    """Of a sun of irradiance 1 or a sky of radiance 1.  streams: cosines of the quadrature."""
    from PythonicDISORT import pydisort
    from PythonicDISORT.subroutines import interpolate

    depth, albedo = slab.depth[colour], slab.albedo[colour]
    moments = slab.moments(streams)
    at = 0.0 if slab.sent_back else depth
    cosine = slab.cosine if slab.sent_back else -slab.cosine
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of large numbers of modes
        if slab.sun is None:
            zeroth = pydisort(depth, albedo, streams, moments, 0.5, 0.0, 0.0, NFourier=1, b_neg=1.0)
            return float(np.squeeze(interpolate(zeroth[3])(cosine, at)))
        result = pydisort(depth, albedo, streams, moments, slab.sun, 1.0, 0.0)
    return float(np.squeeze(interpolate(result[4])(cosine, at, np.radians(slab.azimuth))))


def radiances(slab: Slab, streams: int) -> FloatArray:
    """Of the three colours."""
    return np.array([radiance(slab, colour, streams) for colour in range(3)])


def main() -> None:
    """Print the table, and how far it is from that with half as many streams."""
    for name, slab in SLABS.items():
        most = slab.streams
        fine, coarse = radiances(slab, most), radiances(slab, most // 2)
        error = float(np.abs(coarse / fine - 1.0).max())
        numbers = ", ".join(f"{value:.9g}" for value in fine)
        print(f'    "{name}": ([{numbers}], {error:.1e}),', flush=True)


if __name__ == "__main__":
    main()
