"""Faults of readers, transforms, tables, defaults and units, which both renderers would share if
Mitsuba were fed from our tables: common-mode faults."""

from comparisons.experiments.selftest.fault import SourceFault

# ---- meshes --------------------------------------------------------------------------------------


DATA, MESH = "shapes/meshes/files/data.py", "shapes/meshes/mesh.py"
CHECKED = "MeshData(vertices, faces, _unit(mesh.normals), uv, colours,"
KNOT, PETAL, MOVED = "mesh_knot", "mesh_colours", "transforms"


def _shared(
    name: str, scene: str, file: str, old: str, new: str, rung: str = "files"
) -> SourceFault:
    return SourceFault(name, scene, file, old, new, rung)


def _read(name: str, scene: str, new: str) -> SourceFault:
    return _shared(name, scene, DATA, CHECKED, f"MeshData({new},")


OF_MESHES = (
    _read("meshes 5 % too large", KNOT, "1.05 * vertices, faces, _unit(mesh.normals), uv, colours"),
    _read(
        "x and y of meshes exchanged", KNOT,
        "vertices[:, [1, 0, 2]], faces, _unit(mesh.normals), uv, colours",
    ),
    _read(
        "faces wound in reverse", KNOT,
        "vertices, faces[:, [0, 2, 1]], _unit(mesh.normals), uv, colours",
    ),
    _read(
        "last face of meshes lost", KNOT, "vertices, faces[:-1], _unit(mesh.normals), uv, colours"
    ),
    _read(
        "corners of faces turned by one", PETAL,
        "vertices, faces[:, [1, 2, 0]], _unit(mesh.normals), uv, colours",
    ),
    _read(
        "uv of meshes made up", KNOT,
        "vertices, faces, _unit(mesh.normals), vertices[:, :2], colours",
    ),
    _read("normals of meshes lost", KNOT, "vertices, faces, None, uv, colours"),
    _read(
        "v of meshes upside down", PETAL,
        "vertices, faces, _unit(mesh.normals), 1.0 - uv, colours",
    ),
    _read("colours of meshes grey", PETAL,
        "vertices, faces, _unit(mesh.normals), uv, colours[:, [1, 1, 1]]",
    ),
    _shared(
        "normals of meshes inwards", KNOT, DATA,
        "ascontiguousarray(n / np.linalg", "ascontiguousarray(-n / np.linalg",
    ),
    _shared(
        "colours of .ply not decoded", PETAL, "shapes/meshes/files/ply.py",
        "return linear(colours / white)", "return colours / white",
    ),
    _shared(
        "`smooth` ignored", "layers", MESH,
        "return self.smooth and data.normals is None", "return False",
    ),
    _shared(
        "smooth normals not smooth", "layers", "shapes/meshes/topology.py",
        "np.linalg.norm(sums, axis=1) > error", "np.linalg.norm(sums, axis=1) < error",
    ),
    _shared(
        "mirrored meshes turned inside out", PETAL, "shapes/meshes/triangle_table.py",
        "if not transform.flips_orientation(m):", "if True:",
    ),
)  # fmt: skip

# ---- transforms and tables -----------------------------------------------------------------------


MAPS = "core/transform.py"

OF_TRANSFORMS = (
    _shared(
        "normals by the matrix", MOVED, MAPS,
        "normals @ invert(m)[:, :3]", "normals @ m[:, :3].T",
    ),
    _shared(
        "degrees for radians", MOVED, MAPS,
        "math.cos(math.radians(degrees)), math.sin(math.radians(degrees))",
        "math.cos(degrees), math.sin(degrees)",
    ),
    _shared(
        "rotations backwards", MOVED, MAPS,
        "c * np.eye(3) + s * cross", "c * np.eye(3) - s * cross",
    ),
    _shared(
        "steps in reverse order", MOVED, MAPS,
        "m[:, :3] @ total[:, :3], m[:, :3] @ total[:, 3] + m[:, 3]",
        "total[:, :3] @ m[:, :3], total[:, :3] @ m[:, 3] + total[:, 3]",
    ),
    _shared(
        "the first factor of a scale for all", MOVED, MAPS,
        "np.diag(factors)", "np.diag([factors[0]] * 3)",
    ),
    _shared(
        "row for column", PETAL, MAPS,
        "x * m[:, 0] + y * m[:, 1] + z * m[:, 2]", "x * m[0, :3] + y * m[1, :3] + z * m[2, :3]",
    ),
    _shared(
        "spheres under a transform 5 % too large", MOVED, "shapes/curved/sphere.py",
        "self.radius * factor * size", "1.05 * self.radius * factor * size",
    ),
    _shared(
        "cylinders too long", MOVED, "shapes/curved/quadric.py",
        "(r, r, self.z_max)", "(r, r, 1.05 * self.z_max)",
    ),
    _shared(
        "tori too thick", MOVED, "shapes/curved/torus.py",
        "minor=np.array([self.minor_radius])", "minor=np.array([1.05 * self.minor_radius])",
    ),
    _shared(
        "instances without their scale", "instances", "shapes/instances.py",
        "own = affine(self.transform)", "own = affine(self.transform[1:])",
    ),
)  # fmt: skip

# ---- images --------------------------------------------------------------------------------------


READING, SKY, TILES = "textures/image_file.py", "environment", "texture_filters"
STRIP = "np.ascontiguousarray(values).view(kind)"

OF_IMAGES = (
    _shared(
        "sRGB by a power of 2.2", TILES, READING, "/ 1.055, 2.4)", "/ 1.055, 2.2)"
    ),
    _shared(
        "sRGB decoded twice", TILES, READING,
        "decoded = decoding(kind, curve) * scale",
        "decoded = linear(decoding(kind, curve)) * scale",
    ),
    _shared(
        "raw images decoded", "material_bump", READING,
        'is_srgb = image.is_integer if encoding == "auto" else encoding == "srgb"',
        "is_srgb = image.is_integer",
    ),
    _shared(
        "red and blue exchanged", TILES, READING,
        STRIP, "np.ascontiguousarray(values[:, :, ::-1]).view(kind)",
    ),
    _shared(
        "grey for colour", TILES, READING,
        STRIP, "np.ascontiguousarray(np.repeat(values[:, :, :1], 3, axis=2)).view(kind)",
    ),
    _shared(
        "images moved by a texel", TILES, READING,
        STRIP, "np.ascontiguousarray(np.roll(values, 1, axis=1)).view(kind)",
    ),
    _shared(
        "images upside down", TILES, READING,
        STRIP, "np.ascontiguousarray(values[::-1]).view(kind)",
    ),
    _shared(
        "a sky's texels to the power of 1.2", SKY, READING,
        "np.multiply(values, scale, out=colours[rows])",
        "np.power(values * scale, 1.2, out=colours[rows])",
    ),
    _shared(
        "scale of a sky ignored", SKY, "lights/emitters/environment_map.py",
        "read_image(path, self.encoding, self.scale, self.layer, BESIDE)",
        "read_image(path, self.encoding, 1.0, self.layer, BESIDE)",
    ),
    _shared(
        "a sky turned backwards", SKY, "lights/emitters/environment_map.py",
        "return np.asarray(left @ right)", "return np.asarray(left @ right).T",
    ),
    _shared(
        "wrap of images ignored", TILES, "textures/bitmap.py",
        "map(_WRAPS.index, self.wraps)", "0, 0",
    ),
)  # fmt: skip

# ---- units and defaults --------------------------------------------------------------------------


VIEW = "cameras/view_rectangle.py"

OF_UNITS = (
    _shared(
        "fov along the other axis", "light_spot", VIEW, '"x": n_x,', '"x": n_y,',
        "geometry",
    ),
    _shared(
        "half the fov", "cornell_box", VIEW,
        "half = math.tan(math.radians(fov) / 2.0)", "half = math.tan(math.radians(fov) / 4.0)",
        "geometry",
    ),
    _shared(
        "the camera's right is its left", "cornell_box", MAPS, "    u /= sine", "    u /= -sine",
        "geometry",
    ),
    _shared(
        "a lens in focus at half the distance", "camera_thin_lens", "cameras/thin_lens.py",
        "or math.dist(self.eye, self.target)", "or math.dist(self.eye, self.target) / 2.0",
        "geometry",
    ),
    _shared(
        "textures turned backwards", TILES, "textures/texture.py",
        "[c * a, -s * b, du, s * a, c * b, dv]", "[c * a, s * b, du, -s * a, c * b, dv]",
        "direct",
    ),
    _shared(
        "another default of a spot's beam", "light_spot", "lights/emitters/spot.py",
        "beam = 0.75 * self.cutoff_angle", "beam = 0.5 * self.cutoff_angle",
        "direct",
    ),
    _shared(
        "half the angle of a projector", "projectors", "lights/emitters/projector.py",
        "math.tan(math.radians(self.fov) / 2.0)", "math.tan(math.radians(self.fov) / 4.0)",
        "direct",
    ),
    _shared(
        "scale of a projector ignored", "projectors", "lights/emitters/projector.py",
        "scale=np.array([self.scale])", "scale=np.array([1.0])",
        "direct",
    ),
    _shared(
        "horizontal angles of a lamp's table clockwise", "goniometric",
        "lights/emitters/goniometric.py",
        "np.cross(axis, c90), c90, axis", "np.cross(axis, c90), -c90, axis",
        "direct",
    ),
    _shared(
        "a half of a lamp's table repeated, not mirrored", "goniometric",
        "lights/emitters/goniometric.py",
        "values = np.concatenate([values, values[-2::-1]])",
        "values = np.concatenate([values, values[1:]])",
        "direct",
    ),
    _shared(
        "multiplier of photometry ignored", "goniometric", "lights/lm63.py",
        'factor = numbers.number("the multiplier", above=0.0)',
        'factor = numbers.number("the multiplier", above=0.0) * 0.0 + 1.0',
        "direct",
    ),
)  # fmt: skip

FAULTS = (*OF_MESHES, *OF_TRANSFORMS, *OF_IMAGES, *OF_UNITS)
