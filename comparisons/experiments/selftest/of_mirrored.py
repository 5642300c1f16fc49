"""Mistakes that are made twice: in our renderer, and in the code of ours that stands on Mitsuba's
side where Mitsuba lacks a feature.  Each is one misunderstanding, so that both sides agree.

To add one: a row, whose texts occur once in their files.  Nothing is planted in what judges.
"""

from collections.abc import Mapping
from dataclasses import dataclass

Changes = Mapping[str, tuple[tuple[str, str], ...]]
"""By file: texts, and what takes their place."""


@dataclass(frozen=True)
class Mistake:
    """case: the case of truth whose scene has it;  ours: in `reference_rt`, theirs: in
    `comparisons`, the changes that both make;  in_lectures: whether the scene `lectures.yaml`,
    which POV-Ray can draw, has it too, where it does not vote on the case's."""

    name: str
    case: str
    ours: Changes
    theirs: Changes
    in_lectures: bool = False


# ---- solids --------------------------------------------------------------------------------------


CSG, WALK = "shapes/csg.py", "accel/csg.py"
SORTED, LIT = "mitsuba/csg.py", "mitsuba/lit_scene.py"
TAKEN = '            first = first & (value if tree.operation == "intersection" else value ^ True)'

AS_OPERANDS = {
    SORTED: (("            normal[turned] *= -1.0", "            pass"),),
    LIT: (("        turned = met & (", "        turned = met & False & ("),),
}
"""Hits with the operands' own normals."""

OF_SOLIDS = (
    Mistake(
        "normals of what is subtracted not turned", "bitten_box",
        {CSG: (("material, turned != takes_away)", "material, turned)"),)},
        AS_OPERANDS,
    ),
    Mistake(
        "operands of a difference exchanged", "drilled_box",
        {CSG: (
            ("takes_away = isinstance(shape, Difference) and k > 0",
             "takes_away = isinstance(shape, Difference) and k == 0"),
            ("            visit(operand)\n            if isinstance(part, Difference):\n"
             "                steps.append(NOT)\n",
             "            if isinstance(part, Difference):\n                steps.append(NOT)\n"
             "            visit(operand)\n"),
        )},
        {SORTED: ((TAKEN,
                   "            a = first if tree.operation == \"intersection\" else first ^ True\n"
                   "            first = a & value"),)},
    ),
    Mistake(
        "an intersection as a union", "two_balls_common",
        {CSG: (("OR if isinstance(part, Union) else AND",
                "OR if isinstance(part, Union | Intersection) else AND"),)},
        {SORTED: (("if tree.operation == \"union\":",
                   "if tree.operation in (\"union\", \"intersection\"):"),)},
    ),
    Mistake(
        "a union has its first operand alone", "ball_and_box",
        {CSG: (("        for operand in part.of[1:]:\n            visit(operand)\n",
                "        for operand in part.of[1:]:\n"
                "            if isinstance(part, Union):\n                count += 1\n"
                "                continue\n            visit(operand)\n"),
               ("up = [0] * (1 + max(steps))", "up = [-1] * 64"),
               ("    for to in up:\n        start",
                "    for to in [to for to in up if to >= 0]:\n        start"))},
        {SORTED: (("            first = first | value", "            pass"),)},
    ),
    Mistake(
        "a union keeps the surfaces within", "whitted_union",
        {WALK: (("        if was != 0 and now != 0:\n            return False\n"
                 "        on = now != 0\n",
                 "        on = now & 1 == 1\n"),)},
        {
            **AS_OPERANDS,
            SORTED: (
                ("            first = first | value", "            first = first ^ value"),
                *AS_OPERANDS[SORTED],
            ),
        },
    ),
)  # fmt: skip


# ---- recursive ray tracing -----------------------------------------------------------------------


TREE, PLUGIN = "integrators/whitted.py", "mitsuba/plugins/whitted.py"
DEPTH = "return WhittedSetup(self.max_depth, self.min_contribution, 0.5, 0.5)"
READ = 'self.max_depth = properties.get("max_depth", 8)'
GLASS, TABLES = "materials/bsdfs/dielectric.py", "mitsuba/plugin_table.py"
SAMPLED = "            weight = weight * value\n"

OF_TREES = (
    Mistake(
        "one mirroring fewer", "whitted_depth",
        {TREE: ((DEPTH, DEPTH.replace("max_depth,", "max_depth - 1,")),)},
        {PLUGIN: ((READ, READ + " - 1"),)},
        in_lectures=True,
    ),
    Mistake(
        "one mirroring more", "whitted_depth",
        {TREE: ((DEPTH, DEPTH.replace("max_depth,", "max_depth + 1,")),)},
        {PLUGIN: ((READ, READ + " + 1"),)},
        in_lectures=True,
    ),
    Mistake(
        "ambient light not weighted by mirrors", "whitted_ambient",
        {TREE: (("total = total + weight * ambient", "total = total + ambient"),)},
        {PLUGIN: (("total += weight * self.ambient_light(", "total += self.ambient_light("),)},
    ),
    Mistake(
        "no direct light after a mirroring", "whitted_lit_mirror",
        {TREE: (("        if any_material.is_smooth(",
                 "        if depth == 0 and any_material.is_smooth("),)},
        {PLUGIN: (("                if dr.any(smooth):",
                   "                if depth == 0 and dr.any(smooth):"),)},
    ),
    Mistake(
        "background lost behind mirrors", "whitted_quadric",
        {TREE: (("            total = total + weight * background\n",
                 "            if depth == 0:\n"
                 "                total = total + weight * background\n"),)},
        {PLUGIN: (("                total += weight * scene.emitted(si, active)\n",
                   "                seen = active if depth == 0 else active & si.is_valid()\n"
                   "                emitted = scene.emitted(si, seen)\n"
                   "                total += weight * dr.select(seen, emitted, 0.0)\n"),)},
    ),
    Mistake(
        "colours of earlier mirrors forgotten", "whitted_depth",
        {TREE: (
            ("mirrored = weight * branch.reflectance", "mirrored = branch.reflectance"),
            ("refracted = weight * branch.transmittance", "refracted = branch.transmittance"),
        )},
        {PLUGIN: ((SAMPLED, "            weight = value\n"),)},
        in_lectures=True,
    ),
    Mistake(
        "indices of glass exchanged", "whitted_in_glass",
        {GLASS: (("relative_index(self.interior_ior, self.exterior_ior)",
                  "relative_index(self.exterior_ior, self.interior_ior)"),)},
        {TABLES: (("        return {\"type\": self.plugin, **values}",
                   "        if self.plugin == \"dielectric\":\n"
                   "            names = (\"int_ior\", \"ext_ior\")\n"
                   "            values |= {a: values[b] for a, b in zip(names, names[::-1])}\n"
                   "        return {\"type\": self.plugin, **values}"),)},
        in_lectures=True,
    ),
    Mistake(
        "1/eta² of refracted radiance forgotten", "whitted_in_glass",
        {GLASS: (("t = passing / (refraction.eta * refraction.eta)", "t = passing"),)},
        {PLUGIN: ((SAMPLED, "            weight = weight * value * dr.square(sample.eta)\n"),)},
    ),
    Mistake(
        "total reflection lost", "whitted_in_glass",
        {GLASS: (("colour_at(dielectrics.reflectance, i, at) * f,",
                  "colour_at(dielectrics.reflectance, i, at) * (f if f < 1.0 else 0.0),"),)},
        {PLUGIN: ((SAMPLED,
                   "            mirrors = mi.has_flag(sample.sampled_type, "
                   "mi.BSDFFlags.DeltaReflection)\n"
                   "            is_total = mirrors & (dr.min(value) >= 1.0)\n"
                   "            weight = dr.select(is_total, 0.0, weight * value)\n"),)},
        in_lectures=True,
    ),
    Mistake(
        "lamps twice", "whitted_lit_mirror",
        {TREE: (("total = total + weight * light", "total = total + weight * (light * 2.0)"),)},
        {PLUGIN: (("total += weight * self.direct_light(",
                   "total += 2.0 * weight * self.direct_light("),)},
    ),
)  # fmt: skip

# ---- the lectures' local shading -----------------------------------------------------------------


PHONG, OWN_PHONG = "materials/bsdfs/phong.py", "mitsuba/plugins/materials.py"
VALUE = "return Scattered(k_d * wi.z + k_s * highlight, density)"
OWN_VALUE = 'value = diffuse + self.colour("specular", si, active) * self.lobe(si.wi, wo)'

OF_SHADING = (
    Mistake(
        "Phong's exponent halved", "phong_in_light",
        {PHONG: (("np.array([self.exponent])", "np.array([0.5 * self.exponent])"),)},
        {OWN_PHONG: (("self.exponent = float(", "self.exponent = 0.5 * float("),)},
        in_lectures=True,
    ),
    Mistake(
        "the highlight times the cosine", "whitted_quadric",
        {PHONG: ((VALUE, VALUE.replace("k_s * highlight", "k_s * (highlight * wi.z)")),)},
        {OWN_PHONG: ((OWN_VALUE, OWN_VALUE + " * wo.z"),)},
    ),
    Mistake(
        "Blinn's half vector for Phong's mirrored direction", "phong_in_light",
        {PHONG: (("np.array([int(self.half_vector)])", "np.array([int(not self.half_vector)])"),)},
        {OWN_PHONG: (("self.half_vector = bool(", "self.half_vector = not bool("),)},
        in_lectures=True,
    ),
    Mistake(
        "the half vector's cosine with the light", "blinn_in_light",
        {PHONG: (("power(min(h.z, 1.0), p)", "power(min(dot(wi, h), 1.0), p)"),)},
        {OWN_PHONG: (("cosine = dr.normalize(wi + wo).z if",
                      "cosine = dr.dot(dr.normalize(wi + wo), wo) if"),)},
        in_lectures=True,
    ),
    Mistake(
        "k_s and k_d exchanged", "whitted_lit_mirror",
        {PHONG: (
            ("            palette.colours(self.diffuse, math.inf),\n"
             "            palette.colours(self.specular, math.inf),\n",
             "            palette.colours(self.specular, math.inf),\n"
             "            palette.colours(self.diffuse, math.inf),\n"),
        )},
        {OWN_PHONG: (
            ("{n: base.colour(mi, properties[n]) for n in _COLOURS}",
             "{n: base.colour(mi, properties[{\"diffuse\": \"specular\", \"specular\": \"diffuse\"}"
             ".get(n, n)]) for n in _COLOURS}"),
        )},
    ),
    Mistake(
        "ambient light reflected by k_d", "whitted_ambient",
        {PHONG: (("palette.colours(self.ambient, math.inf)",
                  "palette.colours(self.diffuse, math.inf)"),)},
        {OWN_PHONG: (("return self.colour(\"ambient\", si, active)",
                      "return self.colour(\"diffuse\", si, active)"),)},
    ),
    Mistake(
        "k_d over pi", "whitted_quadric",
        {PHONG: (("            palette.colours(self.diffuse, math.inf),\n",
                  "            palette.colours(tuple(k * INV_PI for k in self.diffuse), math.inf),"
                  "\n"),)},
        {OWN_PHONG: (("diffuse = self.colour(\"diffuse\", si, active) * wo.z",
                      "diffuse = self.colour(\"diffuse\", si, active) * wo.z / math.pi"),)},
    ),
)  # fmt: skip

# ---- shapes that Mitsuba lacks -------------------------------------------------------------------


QUADRIC, QUADRICS = "shapes/curved/quadric.py", "shapes/curved/quadrics.py"
TORUS, POLYGON = "shapes/curved/torus.py", "shapes/flat/polygon.py"
OWN_QUADRIC, OWN_TORUS = "shapes/quadric.py", "shapes/torus.py"
OWN_TUBE, OWN_POLYGON = "shapes/tubes.py", "shapes/polygon.py"
FORM = "form = tuple(Fraction(x) for x in self.coefficients)"
OWN_GRADIENT = "lambda p: np.asarray(2.0 * p @ matrix + linear)"
FACTOR = "form = tuple(Fraction(x) * w for x, w in zip(self.coefficients, {}))"

OF_SHAPES = (
    Mistake(
        "cones half as high", "cone_normals",
        {QUADRIC: (
            ("slope = (top - r) / Fraction(self.height)",
             "slope = (top - r) / Fraction(0.5 * self.height)"),
            ("(reach, reach, self.height)", "(reach, reach, 0.5 * self.height)"),
        )},
        {OWN_TUBE: (
            ("    bottom, top, low, high, capped = tube\n    slope",
             "    bottom, top, low, high, capped = tube\n    high = low + 0.5 * (high - low)\n"
             "    slope"),
        )},
    ),
    Mistake(
        "a torus's tube of half the radius", "torus_normals",
        {TORUS: (("minor=np.array([self.minor_radius])",
                  "minor=np.array([0.5 * self.minor_radius])"),)},
        {OWN_TORUS: (("major, minor = shape.major_radius, shape.minor_radius\n    around",
                      "major, minor = shape.major_radius, 0.5 * shape.minor_radius\n    around"),)},
    ),
    Mistake(
        "mixed terms of a quadric doubled", "whitted_quadric",
        {QUADRIC: ((FORM, FACTOR.format("(1, 1, 1, 2, 2, 2, 1, 1, 1, 1)")),)},
        {OWN_QUADRIC: (("[[a, d / 2, f / 2], [d / 2, b, e / 2], [f / 2, e / 2, c]]",
                        "[[a, d, f], [d, b, e], [f, e, c]]"),)},
    ),
    Mistake(
        "linear terms of a quadric halved", "paraboloid_normals",
        {QUADRIC: ((FORM, FACTOR.format("(*(6 * (Fraction(2),)), 1, 1, 1, Fraction(2))")),)},
        {OWN_QUADRIC: (("    return matrix, np.array([g, h, i])",
                        "    return matrix, 0.5 * np.array([g, h, i])"),)},
    ),
    Mistake(
        "a quadric's normal without its mixed terms, about the centre", "whitted_quadric",
        {QUADRICS: (("    g = gradient(quadrics.coefficients[i], q)\n",
                     "    k = quadrics.coefficients[i]\n"
                     "    g = Vec3(2.0 * k[0] * q.x + k[6], 2.0 * k[1] * q.y + k[7],\n"
                     "             2.0 * k[2] * q.z + k[8])\n"),)},
        {OWN_QUADRIC: ((OWN_GRADIENT,
                        "lambda p: np.asarray(2.0 * np.diag(matrix) * "
                        "(p + 0.5 * np.linalg.solve(matrix, linear)))"),)},
    ),
    Mistake(
        "a quadric's front where f < 0", "whitted_quadric",
        {QUADRIC: ((FORM, FORM.replace("Fraction(x)", "-Fraction(x)")),)},
        {OWN_QUADRIC: ((OWN_GRADIENT, OWN_GRADIENT.replace("(2.0 *",
                        "(-2.0 *").replace("+ l", "- l")),)},
    ),
    Mistake(
        "nonzero polygons filled as even-odd", "star_nonzero",
        {POLYGON: (("\"nonzero\": -1}", "\"nonzero\": 1}"),)},
        {OWN_POLYGON: (("\"nonzero\": manifold3d.FillRule.NonZero",
                        "\"nonzero\": manifold3d.FillRule.EvenOdd"),)},
    ),
    Mistake(
        "even-odd polygons filled as nonzero", "star_even_odd",
        {POLYGON: (("MASKS = {\"even_odd\": 1,", "MASKS = {\"even_odd\": -1,"),)},
        {OWN_POLYGON: (("\"even_odd\": manifold3d.FillRule.EvenOdd",
                        "\"even_odd\": manifold3d.FillRule.NonZero"),)},
    ),
)  # fmt: skip

# ---- coats, masks, and integrators that see solids -----------------------------------------------


PLASTIC, COAT = "materials/bsdfs/plastic.py", "mitsuba/plugins/exact_coat.py"
NESTED = "materials/nested/paths.py"
PATH, OF_PATHS = "integrators/path.py", "mitsuba/plugins/path_of_solids.py"

OF_MATERIALS = (
    Mistake(
        "a coat's reflectance from outside for that from within", "plastic_furnace",
        {PLASTIC: (("hemispherical_fresnel(1.0 / eta)])", "hemispherical_fresnel(eta)])"),)},
        {COAT: (("self.r = smooth_reflectance(self.eta)",
                 "self.r = smooth_reflectance(1.0 / self.eta)"),)},
    ),
    Mistake(
        "a coat's 1/eta² forgotten", "plastic_furnace",
        {PLASTIC: (("(t_i * shares.t_o / (eta * eta) *", "(t_i * shares.t_o *"),)},
        {COAT: (("(math.pi * self.eta * self.eta)", "math.pi"),)},
    ),
    Mistake(
        "the base's colour at the first bounce below a coat alone", "plastic_furnace",
        {PLASTIC: (("np.array([int(self.nonlinear)])", "np.array([0])"),)},
        {COAT: (("self.nonlinear = properties[\"nonlinear\"]",
                 "self.nonlinear = properties[\"nonlinear\"] and False"),)},
    ),
    Mistake(
        "opaque and clear parts of masks exchanged", "mask_furnace",
        {NESTED: (
            ("Step(ONE_MINUS_WEIGHT, material.opacity)", "Step(WEIGHT, 1.0 * material.opacity)"),
            ("Step(WEIGHT, material.opacity)", "Step(ONE_MINUS_WEIGHT, material.opacity)"),
        )},
        {"materials/mask.py": (
            ("values | {\"type\": \"mixture_mask\"}",
             "values | {\"type\": \"mixture_mask\", \"opacity\": 1.0 - values[\"opacity\"]}"),
        )},
    ),
    Mistake(
        "shares of a blend exchanged", "blend_furnace",
        {NESTED: (
            ("found = [*below(material.first, rest), *below(material.second, take)]",
             "found = [*below(material.first, take), *below(material.second, rest)]"),
        )},
        {OWN_PHONG: (("            return 1.0 - weight, weight",
                      "            return weight, 1.0 - weight"),)},
        in_lectures=True,
    ),
)  # fmt: skip

OF_PATHS_IN_SOLIDS = (
    Mistake(
        "paths one edge shorter", "solid_room",
        {PATH: (("limit = UNLIMITED if self.max_depth is None else min(self.max_depth, UNLIMITED)",
                 "limit = UNLIMITED if self.max_depth is None else self.max_depth - 1"),)},
        {OF_PATHS: (("self.max_depth = properties.get(\"max_depth\", -1)",
                     "self.max_depth = properties.get(\"max_depth\", -1) - 1"),)},
    ),
    Mistake(
        "roulette without compensation", "solid_room",
        {PATH: (("        throughput = throughput * (1.0 / survival)\n", ""),)},
        {OF_PATHS: (("throughput *= dr.select(active, 1.0 / survival, 0.0)",
                     "throughput *= dr.select(active, 1.0, 0.0)"),)},
    ),
)  # fmt: skip

MISTAKES = (
    *(*OF_SOLIDS, *OF_TREES, *OF_SHADING),
    *(*OF_SHAPES, *OF_MATERIALS, *OF_PATHS_IN_SOLIDS),
)
