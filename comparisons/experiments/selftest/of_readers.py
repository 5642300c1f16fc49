"""Faults of readers, transforms, tables, defaults and units, which both renderers would share if
Mitsuba were fed from our tables: common-mode faults."""

from comparisons.experiments.selftest.fault import SourceFault

# ---- meshes --------------------------------------------------------------------------------------


DATA, MESH = "shapes/meshes/files/data.py", "shapes/meshes/mesh.py"
CHECKED = "MeshData(vertices, faces, _unit(mesh.normals), uv, colours,"
KNOT, PETAL, MOVED = "mesh_knot", "mesh_colours", "transforms"


def _read(name: str, scene: str, new: str) -> SourceFault:
    return SourceFault(name, scene, DATA, CHECKED, f"MeshData({new},")


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
    _read("normals of meshes lost", KNOT, "vertices, faces, None, uv, colours"),
    _read(
        "v of meshes upside down", PETAL,
        "vertices, faces, _unit(mesh.normals), 1.0 - uv, colours",
    ),
    _read("colours of meshes grey", PETAL,
        "vertices, faces, _unit(mesh.normals), uv, colours[:, [1, 1, 1]]",
    ),
    SourceFault(
        "normals of meshes inwards", KNOT, DATA,
        "ascontiguousarray(n / np.linalg", "ascontiguousarray(-n / np.linalg",
    ),
    SourceFault(
        "colours of .ply not decoded", PETAL, "shapes/meshes/files/ply.py",
        "return linear(colours / white)", "return colours / white",
    ),
    SourceFault(
        "`smooth` ignored", "layers", MESH,
        "return self.smooth and data.normals is None", "return False",
    ),
    SourceFault(
        "smooth normals not smooth", "layers", "shapes/meshes/topology.py",
        "np.linalg.norm(sums, axis=1) > error", "np.linalg.norm(sums, axis=1) < error",
    ),
    SourceFault(
        "mirrored meshes turned inside out", PETAL, "shapes/meshes/triangle_table.py",
        "if not transform.flips_orientation(m):", "if True:",
    ),
)  # fmt: skip

# ---- transforms and tables -----------------------------------------------------------------------


MAPS = "core/transform.py"

OF_TRANSFORMS = (
    SourceFault(
        "normals by the matrix", MOVED, MAPS,
        "normals @ invert(m)[:, :3]", "normals @ m[:, :3].T",
    ),
    SourceFault(
        "degrees for radians", MOVED, MAPS,
        "math.cos(math.radians(degrees)), math.sin(math.radians(degrees))",
        "math.cos(degrees), math.sin(degrees)",
    ),
    SourceFault(
        "rotations backwards", MOVED, MAPS,
        "c * np.eye(3) + s * cross", "c * np.eye(3) - s * cross",
    ),
    SourceFault(
        "steps in reverse order", MOVED, MAPS,
        "m[:, :3] @ total[:, :3], m[:, :3] @ total[:, 3] + m[:, 3]",
        "total[:, :3] @ m[:, :3], total[:, :3] @ m[:, 3] + total[:, 3]",
    ),
    SourceFault(
        "the first factor of a scale for all", MOVED, MAPS,
        "np.diag(factors)", "np.diag([factors[0]] * 3)",
    ),
    SourceFault(
        "row for column", PETAL, MAPS,
        "x * m[:, 0] + y * m[:, 1] + z * m[:, 2]", "x * m[0, :3] + y * m[1, :3] + z * m[2, :3]",
    ),
    SourceFault(
        "spheres under a transform 5 % too large", MOVED, "shapes/curved/sphere.py",
        "self.radius * factor * size", "1.05 * self.radius * factor * size",
    ),
    SourceFault(
        "cylinders too long", MOVED, "shapes/curved/quadric.py",
        "(r, r, self.z_max)", "(r, r, 1.05 * self.z_max)",
    ),
    SourceFault(
        "tori too thick", MOVED, "shapes/curved/torus.py",
        "minor=np.array([self.minor_radius])", "minor=np.array([1.05 * self.minor_radius])",
    ),
    SourceFault(
        "instances without their scale", "instances", "shapes/instances.py",
        "own = affine(self.transform)", "own = affine(self.transform[1:])",
    ),
)  # fmt: skip

# ---- images --------------------------------------------------------------------------------------


READING, SKY, TILES = "textures/image_file.py", "environment", "texture_filters"
STRIP = "np.ascontiguousarray(values).view(kind)"

OF_IMAGES = (
    SourceFault(
        "sRGB by a power of 2.2", TILES, READING, "/ 1.055, 2.4)", "/ 1.055, 2.2)"
    ),
    SourceFault(
        "sRGB decoded twice", TILES, READING,
        "decoded = decoding(kind, curve) * scale",
        "decoded = linear(decoding(kind, curve)) * scale",
    ),
    SourceFault(
        "raw images decoded", "material_bump", READING,
        'is_srgb = image.is_integer if encoding == "auto" else encoding == "srgb"',
        "is_srgb = image.is_integer",
    ),
    SourceFault(
        "red and blue exchanged", TILES, READING,
        STRIP, "np.ascontiguousarray(values[:, :, ::-1]).view(kind)",
    ),
    SourceFault(
        "grey for colour", TILES, READING,
        STRIP, "np.ascontiguousarray(np.repeat(values[:, :, :1], 3, axis=2)).view(kind)",
    ),
    SourceFault(
        "images moved by a texel", TILES, READING,
        STRIP, "np.ascontiguousarray(np.roll(values, 1, axis=1)).view(kind)",
    ),
    SourceFault(
        "images upside down", TILES, READING,
        STRIP, "np.ascontiguousarray(values[::-1]).view(kind)",
    ),
    SourceFault(
        "a sky's texels to the power of 1.2", SKY, READING,
        "np.multiply(values, scale, out=colours[rows])",
        "np.power(values * scale, 1.2, out=colours[rows])",
    ),
    SourceFault(
        "scale of a sky ignored", SKY, "lights/emitters/environment_map.py",
        "read_image(path, self.encoding, self.scale, self.layer)",
        "read_image(path, self.encoding, 1.0, self.layer)",
    ),
    SourceFault(
        "a sky turned backwards", SKY, "lights/emitters/environment_map.py",
        "return np.asarray(left @ right)", "return np.asarray(left @ right).T",
    ),
    SourceFault(
        "wrap of images ignored", TILES, "textures/bitmap.py",
        "map(_WRAPS.index, self.wraps)", "0, 0",
    ),
)  # fmt: skip

# ---- units and defaults --------------------------------------------------------------------------


VIEW = "cameras/view_rectangle.py"

OF_UNITS = (
    SourceFault(
        "fov along the other axis", "light_spot", VIEW, '"x": n_x,', '"x": n_y,'
    ),
    SourceFault(
        "half the fov", "cornell_box", VIEW,
        "half = math.tan(math.radians(fov) / 2.0)", "half = math.tan(math.radians(fov) / 4.0)",
    ),
    SourceFault(
        "the camera's right is its left", "cornell_box", MAPS, "    u /= sine", "    u /= -sine"
    ),
    SourceFault(
        "a lens in focus at half the distance", "camera_thin_lens", "cameras/thin_lens.py",
        "or math.dist(self.eye, self.target)", "or math.dist(self.eye, self.target) / 2.0",
    ),
    SourceFault(
        "textures turned backwards", TILES, "textures/texture.py",
        "[c * a, -s * b, du, s * a, c * b, dv]", "[c * a, s * b, du, -s * a, c * b, dv]",
    ),
    SourceFault(
        "another default of a spot's beam", "light_spot", "lights/emitters/spot.py",
        "beam = 0.75 * self.cutoff_angle", "beam = 0.5 * self.cutoff_angle",
    ),
    SourceFault(
        "half the angle of a projector", "projectors", "lights/emitters/projector.py",
        "math.tan(math.radians(self.fov) / 2.0)", "math.tan(math.radians(self.fov) / 4.0)",
    ),
    SourceFault(
        "scale of a projector ignored", "projectors", "lights/emitters/projector.py",
        "scale=np.array([self.scale])", "scale=np.array([1.0])",
    ),
)  # fmt: skip

FAULTS = (*OF_MESHES, *OF_TRANSFORMS, *OF_IMAGES, *OF_UNITS)
