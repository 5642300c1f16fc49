"""Faults of densities, weights and picks in the path tracer, such as two path tracers written from
one book may share: particles from the lamps must see each (the rung `transport`)."""

from comparisons.experiments.selftest import of_sources
from comparisons.experiments.selftest.fault import SourceFault

_PATH, _LAMPS, _BOX = "integrators/path.py", "tilted_lamps", "colour_bleeding"

FAULTS = (
    SourceFault(
        "light samples count whole beside found lamps", _LAMPS, _PATH,
        "        weight = _mis_weight(setup, LIGHT_SAMPLING, pdf, scattered.density)\n",
        "        weight = 1.0\n", "transport",
    ),
    SourceFault(
        "a found sky counts whole beside light samples", "index_matched", _PATH,
        "        weight = _mis_weight(setup, BSDF_SAMPLING, state.bsdf_pdf, light_pdf)\n"
        "    return state.throughput * background",
        "    return state.throughput * background", "transport",
    ),
    SourceFault(
        "weights that do not sum to one", _LAMPS, "integrators/direct_light.py",
        "    return 1.0 / (1.0 + ratio * ratio)\n",
        "    return 1.0 / (1.0 + 0.5 * ratio * ratio)\n", "transport",
    ),
    SourceFault(
        "another density of diffuse scattering for weights", _LAMPS, "materials/bsdfs/diffuse.py",
        "    return Scattered(colour_at(diffuses.reflectance, i, at) * density, density)\n",
        "    return Scattered(colour_at(diffuses.reflectance, i, at) * density, 0.15)\n",
        "transport",
    ),
    SourceFault(
        "the pick left out of a found lamp's density", _LAMPS, _PATH,
        "        light_pdf = any_light.area_pdf(lights, scene.shapes, state.previous, "
        "state.normal, point)\n",
        "        light_pdf = 0.2 * any_light.area_pdf(lights, scene.shapes, state.previous, "
        "state.normal, point)\n",
        "transport",
    ),
    SourceFault(
        "mirrors and glass weighted as if lights could be sampled", "caustic_glass", _PATH,
        "bsdf_pdf = 0.0 if drawn.is_delta else drawn.pdf", "bsdf_pdf = drawn.pdf", "transport",
    ),
    SourceFault(
        "light samples at the first surface alone", _BOX, _PATH,
        "        if scratch.lit.codes[j] >= 0:\n            light,",
        "        if scratch.lit.codes[j] >= 0 and depth == 0:\n            light,", "transport",
    ),
    SourceFault(
        "drawn directions weighted as if uniform on the hemisphere", _BOX, _PATH,
        "    throughput, eta = state.throughput * drawn.weight, state.eta * drawn.eta\n",
        "    value = drawn.weight * (2.0 * 3.141592653589793 * drawn.pdf)\n"
        "    throughput, eta = state.throughput * value, state.eta * drawn.eta\n", "transport",
    ),
)  # fmt: skip

_ALSO = (
    "direct light counted twice",
    "probability of a light forgotten",
    "roulette without compensation",
    "roulette that compensates too little",
)

SEEN = (
    *FAULTS,
    *(one for one in (*of_sources.FAULTS, *of_sources.OF_KERNELS) if one.name in _ALSO),
)
"""These, and those of `of_sources` that are of the same sort."""
