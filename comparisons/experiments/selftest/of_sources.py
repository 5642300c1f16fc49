"""Faults of the renderer's source: typical bugs of renderers, of one or two lines.

`tests/comparisons/experiments/test_selftest.py` checks that each old text occurs exactly once in
its file."""

from comparisons.experiments.selftest.fault import SourceFault

# ---- layers, filters, traversal, textures, cameras, lights --------------------------------------


LAYERS, CAST, IMAGES = "layers", "display_modes", "texture_filters"

OF_KERNELS = (
    SourceFault(
        "distance short by 1e-3", CAST, "integrators/ray_cast.py",
        "hit.t * length(ray.d)", "hit.t * length(ray.d) * 0.999",
    ),
    SourceFault(
        "depth of layers short by 1e-3", LAYERS, "integrators/ray_cast.py",
        "hit.t * length(ray.d)", "hit.t * length(ray.d) * 0.999",
    ),
    SourceFault(
        "id of layers one too large", LAYERS, "integrators/ray_cast.py",
        "whose.shape, where.u", "whose.shape + 1, where.u",
    ),
    SourceFault(
        "albedo of layers without the filter's weight", LAYERS, "rendering/tiles.py",
        "albedo = albedo + own * seen.weight", "albedo = albedo + own",
    ),
    SourceFault(
        "geometric normal in layers", LAYERS, "rendering/tiles.py",
        "normal = normal + point.ns * seen.weight", "normal = normal + point.n * seen.weight",
    ),
    SourceFault(
        "variance of one sample", LAYERS, "rendering/accumulation.py",
        "np.divide(1.0, spp * (spp - 1.0))", "np.divide(1.0, spp - 1.0)",
    ),
    SourceFault(
        "variance over n for n - 1", LAYERS, "rendering/accumulation.py",
        "np.divide(1.0, spp * (spp - 1.0))", "np.divide(1.0, spp * (spp - 0.0))",
    ),
    SourceFault(
        "weights of a filter ignored", "filter_lanczos", "rendering/tiles.py",
        "vector_of(scratch.totals, 0, k) * weights[k]", "vector_of(scratch.totals, 0, k)",
    ),
    SourceFault(
        "filter's weight of x alone", "filter_catmull_rom", "rendering/tiles.py",
        "weight_x * weight_y * stratum.weight", "weight_x * stratum.weight",
    ),
    SourceFault(
        "any-hit misses one triangle", "mesh_knot", "accel/geometry.py",
        "        # Tested once per leaf: a test after each",
        "        if any_hit and closest.row == 5000:\n            closest = no_hit(ray)\n"
        "        # Tested once per leaf: a test after each",
    ),
    SourceFault(
        "closest hit misses one triangle", "mesh_knot", "accel/leaf.py",
        "        row = row_of(bvh, first + lane)\n        closest = _nearer(",
        "        row = row_of(bvh, first + lane)\n        if row == 5000:\n            continue\n"
        "        closest = _nearer(",
    ),
    SourceFault(
        "normals of instances as vectors", "transforms", "shapes/instances.py",
        "    covector = world_covector(instances, i, point.n)\n",
        "    covector = world_vector(instances, i, point.n)\n",
    ),
    SourceFault(
        "shading normals of instances as vectors", LAYERS, "shapes/instances.py",
        "normalize(world_covector(instances, i, point.ns))",
        "normalize(world_vector(instances, i, point.ns))",
    ),
    SourceFault(
        "texels half a texel off", IMAGES, "textures/bitmap.py",
        "u * bitmaps.width[i] - 0.5,", "u * bitmaps.width[i],",
    ),
    SourceFault(
        "mirrored wrap that repeats the edge twice", IMAGES, "textures/bitmap.py",
        "        return min(i, 2 * n - 1 - i)\n", "        return min(i, 2 * n - i) % n\n", "files",
    ),
    SourceFault(
        "slope of bumps along v turned", "material_bump", "textures/bitmap.py",
        "along_x * bitmaps.width[i], -along_y", "along_x * bitmaps.width[i], along_y",
    ),
    SourceFault(
        "green of a normal map turned", "material_normal_map", "materials/nested/tilted.py",
        "2.0 * rgb.y - 1.0", "1.0 - 2.0 * rgb.y",
    ),
    SourceFault(
        "holes and leather of masks exchanged", "material_mask", "materials/nested/flattened.py",
        "            weight *= w if code == WEIGHT else 1.0 - w\n",
        "            weight *= 1.0 - w if code == WEIGHT else w\n",
    ),
    SourceFault(
        "spot that falls off by squares", "light_spot", "lights/emitters/spot.py",
        "    return float((spots.cutoff[i] - angle) / (spots.cutoff[i] - spots.beam[i]))\n",
        "    x = float((spots.cutoff[i] - angle) / (spots.cutoff[i] - spots.beam[i]))\n"
        "    return x * x\n",
    ),
    SourceFault(
        "pdf of the sky 5 % small", "environment", "lights/emitters/environment_map.py",
        "found.radiance, found.light / table.total[0], wi",
        "found.radiance, found.light / table.total[0] * 0.95, wi",
    ),
    SourceFault(
        "probability of a light forgotten", "many_lights", "integrators/path.py",
        "            light, picked = light_of(scratch.lit, j), picked_in(scratch.lit, j)\n",
        "            light, picked = light_of(scratch.lit, j), picked_in(scratch.lit, j)\n"
        "            picked = Pick(picked.light, 1.0 / any_light.count(scene.lights))\n",
    ),
    SourceFault(
        "plane of focus a sphere", "camera_thin_lens", "cameras/thin_lens.py",
        "    s = view.corner + view.right * x + view.down * y\n",
        "    s = normalize(view.corner + view.right * x + view.down * y)\n",
    ),
    SourceFault(
        "lens points in a square", "camera_thin_lens", "cameras/thin_lens.py",
        "    a, b = concentric_disk(lens[0], lens[1])\n",
        "    a, b = 2.0 * lens[0] - 1.0, 2.0 * lens[1] - 1.0\n",
    ),
    SourceFault(
        "one edge too many", "cornell_box", "integrators/path.py",
        "        if depth + 1 >= path.max_depth:\n            break\n",
        "        if depth >= path.max_depth:\n            break\n",
    ),
    SourceFault(
        "roulette that compensates too little", "colour_bleeding", "integrators/path.py",
        "        throughput = throughput * (1.0 / survival)\n",
        "        throughput = throughput * (1.0 / max(survival, 0.8))\n",
    ),
    SourceFault(
        "pane that reflects once", "material_thin_dielectric", "materials/bsdfs/thin_dielectric.py",
        "    r = 2.0 * face.reflectance / (1.0 + face.reflectance)\n", "    r = face.reflectance\n",
    ),
    SourceFault(
        "coat without internal reflection", "material_plastic", "materials/bsdfs/plastic.py",
        "            np.array([hemispherical_fresnel(1.0 / eta)]),\n",
        "            np.array([0.0]),\n",
    ),
    SourceFault(
        "background lost behind mirrors", "spheres_whitted", "integrators/whitted.py",
        "            total = total + weight * background\n",
        "            total = total + weight * background * (1.0 if depth == 0 else 0.0)\n",
    ),
    SourceFault(
        "mirrors in mirrors black after two", "whitted_classic", "integrators/whitted.py",
        "        if depth == whitted.max_depth:\n",
        "        if depth == min(whitted.max_depth, 2):\n",
    ),
    SourceFault(
        "checks of a third", "whitted_classic", "textures/checker.py",
        "    is_low_u = u - math.floor(u) < 0.5\n",
        "    is_low_u = u - math.floor(u) < 0.34\n",
    ),
    SourceFault(
        "the same numbers for two samples", LAYERS, "sampling/independent.py",
        "np.uint64(pixel)), np.uint64(sample))", "np.uint64(pixel)), np.uint64(sample // 2))",
    ),
)  # fmt: skip


# ---- shapes, materials, integrators -------------------------------------------------------------


BOX, KNOT, GLASS = "colour_bleeding", "mesh_knot", "caustic_glass"
METAL, SKY = "material_rough_conductor", "environment"

FAULTS = (
    SourceFault(
        "direct light counted twice", BOX, "integrators/path.py",
        "        weight = _mis_weight(setup, BSDF_SAMPLING, state.bsdf_pdf, light_pdf)\n"
        "    return state.throughput * any_light.emitted",
        "    return state.throughput * any_light.emitted",
    ),
    SourceFault(
        "cosine missing after the first bounce", BOX, "integrators/path.py",
        "    throughput, eta = state.throughput * drawn.weight, state.eta * drawn.eta\n",
        "    throughput, eta = state.throughput * drawn.weight, state.eta * drawn.eta\n"
        "    wi, n = drawn.wi, point.ns\n"
        "    cosine = wi.x * n.x + wi.y * n.y + wi.z * n.z\n"
        "    if depth == 0 and cosine > 0.0:\n"
        "        throughput = throughput * (0.6666666666666666 / cosine)\n",
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
        "    across = turns(right, -back) * sky.width - 0.5\n",
        "    across = turns(right, -back) * sky.width\n",
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
    SourceFault(
        "another probability at the root of the light tree", "many_lights",
        "lights/selection/choice.py",
        "        probability *= child.probability\n",
        "        probability *= child.probability * (0.9 if probability == 1.0 else 1.0)\n",
    ),
    SourceFault(
        "lights below a grazing cosine left out", "soft_shadows", "integrators/direct_light.py",
        "    wi = to_local(shading.frame, light.wi)\n    scattered",
        "    wi = to_local(shading.frame, light.wi)\n    if abs(wi.z) < 0.05:\n"
        "        black = Vec3(0.0, 0.0, 0.0)\n        return Direct(light, black, black, 0.0)\n"
        "    scattered",
    ),
    SourceFault(
        "roulette without compensation beyond edge 8", "white_corridor", "integrators/path.py",
        "        throughput = throughput * (1.0 / survival)\n",
        "        throughput = throughput * (1.0 if depth > 8 else 1.0 / survival)\n",
    ),
    SourceFault(
        "the numbers of the third edge again for the fourth", "white_corridor",
        "integrators/path.py",
        "    count, dimension = any_light.count(lights), sampling.PER_BOUNCE * depth\n",
        "    count, dimension = any_light.count(lights), sampling.PER_BOUNCE * depth\n"
        "    dimension = sampling.PER_BOUNCE * 2 if depth == 3 else dimension\n",
    ),
    SourceFault(
        "density of rough glass without eta²", "material_rough_dielectric",
        "materials/bsdfs/rough_dielectric.py",
        "    spread = refraction.cos_t / (gap * gap)  # wo + eta wi is eta gap h\n",
        "    spread = refraction.cos_t / (gap * gap * eta * eta)\n", "sampling",
    ),
    SourceFault(
        "roulette 1 % too bright", BOX, "integrators/path.py",
        "        throughput = throughput * (1.0 / survival)\n",
        "        throughput = throughput * (1.01 / survival)\n", "sampling",
    ),
    SourceFault(
        "repeated images clamped at their last texel", IMAGES, "textures/bitmap.py",
        "        return min(i, 2 * n - 1 - i)\n    return i % n\n",
        "        return min(i, 2 * n - 1 - i)\n    return n - 1 if i == n else i % n\n", "files",
    ),
    SourceFault(
        "normals of what a solid lacks not turned", "csg_inside", "accel/geometry.py",
        "                point.p, -point.n, -point.ns, point.error, point.material, point.light\n",
        "                point.p, point.n, point.ns, point.error, point.material, point.light\n",
        "solids",
    ),
    SourceFault(
        "a sky clamped at its seam", SKY, "lights/emitters/environment_map.py",
        "    beside, row = select(x + 1.0 < sky.width, x + 1.0, 0.0), y * sky.width\n",
        "    beside, row = smaller(x + 1.0, sky.width - 1.0), y * sky.width\n",
        "files",
    ),
)  # fmt: skip
