"""Mistakes in the source of paths through media, each of which its cases of truth see."""

from pathlib import Path
from typing import NamedTuple

import pytest
import truth_of_patched

from comparisons.experiments.selftest.fault import PACKAGE, patched, run_worker
from comparisons.experiments.selftest.kept_kernels import link_kept
from comparisons.truth.case import cases

SCENES = Path(__file__).parents[3] / "scenes" / "truth"

PATH, TABLES, PHASE = "integrators/media_path.py", "media/tables.py", "media/phase.py"


class Fault(NamedTuple):
    """The text `old`, once in `file` of the package, is replaced by `new`; `cases` must see it."""

    name: str
    file: str
    old: str
    new: str
    cases: tuple[str, ...]


FAULTS = (
    Fault(
        "albedo 2 % low", TABLES, "scattered = sigma_t *", "scattered = 0.98 * sigma_t *",
        ("half_space_sun_1", "slab_sky_5", "white_fog"),
    ),
    Fault(
        "sign of g", TABLES, "np.array([lobe.g for", "np.array([-lobe.g for",
        ("sun_through_haze", "slab_sun_2"),
    ),
    Fault(
        "scale forgotten", TABLES, "medium.scale for", "1.0 for", ("smoke_in_smoke",),
    ),
    Fault(
        "shares of a blend exchanged", PHASE,
        "(1.0 - self.weight, self.first), (self.weight, self.second)",
        "(self.weight, self.first), (1.0 - self.weight, self.second)",
        ("sun_through_dust", "slab_sun_12"),
    ),
    Fault(
        "shadow rays not attenuated", PATH,
        "scattered.value * light.radiance * _left(way.passed.all, 0.0)",
        "scattered.value * light.radiance", ("floor_in_smoke", "sun_on_fog"),
    ),
    Fault(
        "shadow rays end at boundaries", PATH,
        "        if media.passes[point.material] == 0:\n            return Way(False",
        "        if point.material >= 0:\n            return Way(False",
        ("sun_on_fog", "floor_under_smoke"),
    ),
    Fault(
        "distance of a shadow ray without its length", PATH,
        "return Way(True, _further(media, medium, passed, ray.t_max * unit))",
        "return Way(True, _further(media, medium, passed, ray.t_max))",
        ("floor_in_smoke", "point_in_fog"),
    ),
    Fault(
        "the same beside boundaries without a surface", PATH,
        "passed = _further(media, medium, passed, hit.t * unit)",
        "passed = _further(media, medium, passed, hit.t)", ("point_by_ball",),
    ),
    Fault(
        "fog ends behind the scene", PATH,
        "return Way(True, _further(media, medium, passed, ray.t_max * unit))",
        "return Way(True, _further(media, medium, passed, min(ray.t_max * unit, 3.0)))",
        ("endless_fog",),
    ),
    Fault(
        "density of the wrong colour", PATH,
        "ratio = ratio * row_of(media.sigma_t, medium) * inverse",
        "ratio = ratio * row_of(media.sigma_t, medium) * (1.0 / media.sigma_t[medium, 0])",
        ("sun_on_fog",),
    ),
    Fault(
        "weights of colours forget the way", PATH,
        "ratio = ratio * _left(passed.sampled, taken)", "ratio = ratio",
        ("half_space_sky_1",),  # of light scattered once the mean is right
    ),
    Fault(
        "light of media that only absorb is not taken", PATH,
        "throughput = throughput * _left(passed.all, taken)",
        "throughput = throughput * _left(passed.sampled, taken)", ("smoke_slab", "ink_in_glass"),
    ),
    Fault(
        "sides of boundaries exchanged", PATH,
        "        medium = medium_beyond(media, point, ray.d, medium)\n"
        "        rest = ray_from(point, ray.d)\n"
        "        ray = Ray(rest.o, rest.d, ray.t_max - hit.t)\n\n\n@kernel\ndef _look",
        "        medium = medium_beyond(media, point, -ray.d, medium)\n"
        "        rest = ray_from(point, ray.d)\n"
        "        ray = Ray(rest.o, rest.d, ray.t_max - hit.t)\n\n\n@kernel\ndef _look",
        ("smoke_ball", "smoke_in_row"),
    ),
    Fault(
        "a medium is not left", TABLES,
        "return int(inside if dot(d, point.n) < 0.0 else outside)",
        "return int(inside if dot(d, point.n) < 0.0 else max(outside, medium))",
        ("smoke_ball", "milk_in_glass"),
    ),
    Fault(
        "boundaries counted twice", PATH,
        "        passed = _further(media, medium, passed, hit.t)\n",
        "        passed = _further(media, medium, passed, hit.t)\n"
        "        if hit.kind >= 0:\n"
        "            passed = _further(media, medium, passed, hit.t)\n",
        ("smoke_ball",),
    ),
    Fault(
        "the camera's medium forgotten", PATH, "hue, medium = Vec3(1.0, 1.0, 1.0), 0, setup.camera",
        "hue, medium = Vec3(1.0, 1.0, 1.0), 0, -1", ("lamp_through_smoke", "point_in_fog"),
    ),
    Fault(
        "phase sampled otherwise than evaluated", PHASE,
        "_cosine(lobes.code[i], lobes.g[i], u0)", "_cosine(lobes.code[i], 0.97 * lobes.g[i], u0)",
        ("slab_sky_3",),
    ),
    Fault(
        "Rayleigh's phase function without its square", PHASE,
        "_INV_4_PI * (1.0 + cosine * cosine)", "_INV_4_PI * (1.0 + abs(cosine))", ("sun_on_air",),
    ),
    Fault(
        "light and phase samples not weighted against each other", PATH,
        "weight = _weight(setup.path, LIGHT_SAMPLING, density, reached)", "weight = 1.0",
        ("white_fog", "half_space_sky_3"),
    ),
    Fault(
        "the density of scattered rays is that of all directions", PATH,
        "vertex = Vertex(point.p, black, phase(media.lobes, medium, dot(ray.d, d)), _mean(ratio))",
        "vertex = Vertex(point.p, black, 0.25 / math.pi, _mean(ratio))", ("slab_sky_3",),
    ),
    Fault(
        "roulette in the density of scattered rays alone", PATH,
        "            throughput = throughput * (1.0 / survival)\n",
        "            throughput = throughput * (1.0 / survival)\n"
        "            pdf = vertex.pdf * survival\n"
        "            vertex = Vertex(vertex.p, vertex.normal, pdf, vertex.mean)\n",
        ("foggy_room", "half_space_sky_1"),
    ),
    Fault(
        "roulette without its weight", PATH, "throughput = throughput * (1.0 / survival)",
        "throughput = throughput * 1.0", ("foggy_room", "half_space_sun_2"),
    ),
    Fault(
        "a scattering too many", PATH,
        "            if depth + 1 == path.max_depth:\n                break\n"
        "            picked = _light_for(scene, point.p, black",
        "            picked = _light_for(scene, point.p, black", ("sun_on_fog", "point_by_ball"),
    ),
)  # fmt: skip
"""The 21st is what Mitsuba 3.9.1's volpathmis does: findings/mitsuba-volpathmis-roulette.sh."""


def planted(fault):
    """The package's source with the fault."""
    text = (PACKAGE / fault.file).read_text(encoding="utf-8")
    assert text.count(fault.old) == 1, fault.name
    return text.replace(fault.old, fault.new)


def test_faults_fit_the_source_and_the_cases():
    assert len(FAULTS) >= 15
    for fault in FAULTS:
        compile(planted(fault), fault.file, "exec")
        assert set(fault.cases) <= set(cases()), fault.name


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS, ids=[fault.name for fault in FAULTS])
def test_a_mistake_is_seen_by_its_cases(fault):
    """Each case sees it, not only one of them."""
    task = {"cases": fault.cases, "scenes": str(SCENES), "threads": 1}
    with patched(fault.file, planted(fault)) as own:
        link_kept([fault.file], Path(own["REFERENCE_RT_CACHE"]))
        found = run_worker(truth_of_patched.__file__, task, own, 600.0)
    assert {name: verdict for name, (verdict, _) in found.items()} == dict.fromkeys(
        fault.cases, "off"
    ), found
