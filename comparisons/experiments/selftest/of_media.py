"""Faults of media: of scenes, and of the source of paths through media and of phase functions."""

from comparisons.experiments.selftest.fault import SceneFault, SourceFault
from comparisons.experiments.selftest.of_scenes import entry, named, part
from reference_rt.media import HenyeyGreenstein, Isotropic

BALLS, FOG, MILK, INK = "coloured_fog", "fog", "milk_glass", "absorbing_glass"

OF_SCENES = (
    SceneFault("a medium three times as dense", BALLS, named("media", "even", {"scale": 3.0})),
    SceneFault("albedo of a medium halved", BALLS,
               named("media", "even", {"albedo": (0.475, 0.45, 0.35)})),
    SceneFault("g of the other sign", BALLS,
               named("media", "forth", {"phase": HenyeyGreenstein(g=-0.8)})),
    SceneFault("isotropic for Henyey and Greenstein", FOG,
               named("media", "fog", {"phase": Isotropic()})),
    SceneFault("two media exchanged", BALLS, entry("shapes", 3, interior="back")),
    SceneFault("a medium outside of its shape", BALLS,
               entry("shapes", 2, interior=None, exterior="even")),
    SceneFault("camera not in its medium", FOG, part("camera", medium=None)),
    SceneFault("extinction taken for absorption alone", FOG,
               named("media", "fog", {"scale": 1.95, "albedo": (0.4872,) * 3})),
    SceneFault("red and blue of a medium exchanged", INK,
               named("media", "amber", {"sigma_t": (3.0, 0.9, 0.15)})),
    SceneFault("scale of a medium forgotten", INK,
               named("media", "dense emerald", {"scale": 1.0})),
    SceneFault("mean density for all colours", MILK,
               named("media", "tea", {"sigma_t": (1.767, 1.767, 1.767)})),
)  # fmt: skip

PATH, TABLES, PHASE = "integrators/media_path.py", "media/tables.py", "media/phase.py"

FAULTS = (
    *OF_SCENES,
    SourceFault(
        "sign of g in the table of media", BALLS, TABLES, "np.array([lobe.g for",
        "np.array([-lobe.g for", "sampling",
    ),
    SourceFault(
        "shares of a blend of phase functions exchanged", MILK, PHASE,
        "(1.0 - self.weight, self.first), (self.weight, self.second)",
        "(self.weight, self.first), (1.0 - self.weight, self.second)", "sampling",
    ),
    SourceFault(
        "phase function sampled by another g", BALLS, PHASE,
        "_cosine(lobes.code[i], lobes.g[i], u0)", "_cosine(lobes.code[i], 0.9 * lobes.g[i], u0)",
        "sampling",
    ),
    SourceFault(
        "Rayleigh's phase function without its square", MILK, PHASE,
        "_INV_4_PI * (1.0 + cosine * cosine)", "_INV_4_PI * (1.0 + abs(cosine))", "sampling",
    ),
    SourceFault(
        "flights of red for all colours", BALLS, PATH,
        "            sigma = media.sigma_t[medium, hue]\n",
        "            sigma = media.sigma_t[medium, 0]\n", "sampling",
    ),
    SourceFault(
        "weights of colours forget the way", BALLS, PATH,
        "ratio = ratio * _left(passed.sampled, taken)", "ratio = ratio", "sampling",
    ),
    SourceFault(
        "scattering by the density of red", BALLS, PATH,
        "inverse = 1.0 / media.sigma_t[medium, hue]", "inverse = 1.0 / media.sigma_t[medium, 0]",
    ),
    SourceFault(
        "albedo of all media 5 % low", BALLS, TABLES, "scattered = sigma_t *",
        "scattered = 0.95 * sigma_t *",
    ),
    SourceFault(
        "shadow rays not attenuated by media", BALLS, PATH,
        "scattered.value * light.radiance * _left(way.passed.all, 0.0)",
        "scattered.value * light.radiance",
    ),
    SourceFault(
        "shadow rays end at boundaries of media", BALLS, PATH,
        "        if media.passes[point.material] == 0:\n            return Way(False",
        "        if point.material >= 0:\n            return Way(False",
    ),
    SourceFault(
        "light of media that only absorb not taken", INK, PATH,
        "throughput = throughput * _left(passed.all, taken)",
        "throughput = throughput * _left(passed.sampled, taken)",
    ),
    SourceFault(
        "a medium is not left", BALLS, TABLES,
        "return int(inside if dot(d, point.n) < 0.0 else outside)",
        "return int(inside if dot(d, point.n) < 0.0 else max(outside, medium))",
    ),
    SourceFault(
        "boundaries of media counted twice", INK, PATH,
        "        passed = _further(media, medium, passed, hit.t)\n",
        "        passed = _further(media, medium, passed, hit.t)\n"
        "        if hit.kind >= 0:\n"
        "            passed = _further(media, medium, passed, hit.t)\n",
    ),
    SourceFault(
        "the camera's medium forgotten by paths", FOG, PATH,
        "hue, medium = Vec3(1.0, 1.0, 1.0), 0, setup.camera",
        "hue, medium = Vec3(1.0, 1.0, 1.0), 0, -1",
    ),
    SourceFault(
        "light samples count whole beside phase samples", BALLS, PATH,
        "weight = _weight(setup.path, LIGHT_SAMPLING, density, reached)", "weight = 1.0",
    ),
)  # fmt: skip
