"""Faults of the renderer's source: typical bugs of renderers, of one or two lines.

`tests/comparisons/experiments/test_selftest.py` checks that each old text occurs exactly once in
its file.
"""

from comparisons.experiments.selftest.fault import SourceFault

BOX, KNOT, GLASS = "colour_bleeding", "mesh_knot", "caustic_glass"
METAL, SKY = "material_rough_conductor", "environment"

FAULTS = (
    SourceFault(
        "direct light counted twice", BOX, "integrators/path.py",
        "        weight = _mis_weight(path.strategy, _BSDF_SAMPLING, state.bsdf_pdf, light_pdf)\n"
        "    return state.throughput * any_light.emitted",
        "    return state.throughput * any_light.emitted",
    ),
    SourceFault(
        "cosine missing after the first bounce", BOX, "integrators/path.py",
        "    throughput = state.throughput * scattered.weight\n",
        "    throughput = state.throughput * scattered.weight\n"
        "    if depth == 0 and scattered.wi.z > 0.0:\n"
        "        throughput = throughput * (0.6666666666666666 / scattered.wi.z)\n",
    ),
    SourceFault(
        "MIS weights that do not sum to one", "veach_mis", "integrators/direct_light.py",
        "    return 1.0 / (1.0 + ratio * ratio)\n",
        "    return 1.0 / (1.0 + 0.5 * ratio * ratio)\n",
    ),
    SourceFault(
        "roulette without compensation", BOX, "integrators/path.py",
        "        throughput = throughput * (1.0 / survival)\n", "",
    ),
    SourceFault(
        "1/eta² forgotten", GLASS, "materials/bsdfs/dielectric.py",
        "    t = passing / (refraction.eta * refraction.eta)\n", "    t = passing\n",
    ),
    SourceFault(
        "biased warp", BOX, "sampling/warp.py",
        "    r = math.sqrt(u0)\n    cos_phi, sin_phi = on_circle(u1)\n"
        "    return Vec3(r * cos_phi, r * sin_phi, math.sqrt(1.0 - u0))\n",
        "    r = u0\n    cos_phi, sin_phi = on_circle(u1)\n"
        "    return Vec3(r * cos_phi, r * sin_phi, math.sqrt(1.0 - u0 * u0))\n",
    ),
    SourceFault(
        "seed ignored", BOX, "sampling/sobol.py",
        "combine(setup.seed, np.uint64(pixel))", "combine(np.uint64(0), np.uint64(pixel))",
    ),
    SourceFault(
        "one leaf missing from the hierarchy", KNOT, "accel/leaf.py",
        "    met = project_leaf(corners, first, size, shear, seen)\n",
        "    met = project_leaf(corners, first, size, shear, seen)\n"
        "    if first <= 5000 < first + size:\n        met = 0\n",
    ),
    SourceFault(
        "normals of spheres flipped", GLASS, "shapes/curved/sphere.py",
        "    return SurfacePoint(p, n, n, error, spheres.material[i], spheres.light[i])\n",
        "    return SurfacePoint(p, n, -n, error, spheres.material[i], spheres.light[i])\n",
    ),
    SourceFault(
        "shadow rays begin 1 % late", "soft_shadows", "core/ray.py",
        "    o = leave(point, target - point.p)\n    w = target - o\n",
        "    o = leave(point, target - point.p)\n"
        "    w = (target - o) * 0.99\n    o = target - w\n",
    ),
    SourceFault(
        "no offset from surfaces", BOX, "core/ray.py",
        "    return point.p + point.n * point.error\n", "    return point.p\n",
    ),
    SourceFault(
        "Fresnel of one polarisation", GLASS, "materials/microfacet/fresnel.py",
        "0.5 * (s * s + p * p)",
        "s * s",
    ),
    SourceFault(
        "half a pixel off in the camera", BOX, "rendering/tiles.py",
        "    dx, weight_x = film_offset(film_filter, u0)\n",
        "    dx, weight_x = film_offset(film_filter, u0)\n    dx = dx + 0.5\n",
    ),
    SourceFault(
        "masking forgotten in rough metal", METAL, "materials/bsdfs/rough_conductor.py",
        "half.cosine) * (normals * g1(m, wi)), normals)",
        "half.cosine) * normals, normals)",
    ),
    SourceFault(
        "Beckmann in place of GGX", METAL, "materials/microfacet/ggx_and_smith.py",
        "    if m.kind == GGX:\n        norm = slope2", "    if m.kind < 0:\n        norm = slope2",
    ),
    SourceFault(
        "sky off by half a texel", SKY, "lights/emitters/environment_map.py",
        "    across, down = azimuth * width - 0.5,", "    across, down = azimuth * width,",
    ),
    SourceFault(
        "1/pi written as 0.32", BOX, "materials/bsdfs/diffuse.py",
        "    return Scattered(colour_at(diffuses.reflectance, i, at) * density, density)\n",
        "    return Scattered(colour_at(diffuses.reflectance, i, at) * (wi.z * 0.32), density)\n",
    ),
    SourceFault(
        "light of the back of lamps", BOX, "lights/emitters/area.py",
        "    if q.light < 0 or dot(q.n, w) <= 0.0:\n", "    if q.light < 0:\n",
    ),
)  # fmt: skip
