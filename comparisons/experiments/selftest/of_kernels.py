"""Faults of the renderer's source: layers, filters, traversal, textures, cameras, lights.

As `of_sources`: each old text occurs exactly once in its file.
"""

from comparisons.experiments.selftest.fault import SourceFault

LAYERS, CAST, IMAGES = "layers", "display_modes", "texture_filters"

FAULTS = (
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
        "    return FilmRay(ray, weight_x * weight_y)\n", "    return FilmRay(ray, weight_x)\n",
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
        "        return min(i, 2 * n - 1 - i)\n", "        return min(i, 2 * n - i) % n\n",
    ),
    SourceFault(
        "slope of bumps along v turned", "material_bump", "textures/bitmap.py",
        "along_x * bitmaps.width[i], -along_y", "along_x * bitmaps.width[i], along_y",
    ),
    SourceFault(
        "green of a normal map turned", "material_normal_map", "materials/nested/normal_map.py",
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
        "float(luminance(arriving) / table.total[0])",
        "float(luminance(arriving) / table.total[0] * 0.95)",
    ),
    SourceFault(
        "probability of a light forgotten", "many_lights", "integrators/path.py",
        "    pdf = light.pdf * picked.probability\n",
        "    pdf = light.pdf / any_light.count(scene.lights)\n",
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
        "            if depth + 1 >= path.max_depth:\n",
        "            if depth + 1 >= path.max_depth + 1:\n",
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
        "    low_u = u - math.floor(u) < 0.5\n", "    low_u = u - math.floor(u) < 0.34\n",
    ),
    SourceFault(
        "the same numbers for two samples", LAYERS, "sampling/independent.py",
        "np.uint64(pixel)), np.uint64(sample))", "np.uint64(pixel)), np.uint64(sample // 2))",
    ),
)  # fmt: skip
