"""Parameters of Mitsuba's plugins that may be textures."""

from comparisons.mitsuba.colours import SPECTRA, Rgb, colour, constant, luminance
from comparisons.mitsuba.node import Node, Reading
from comparisons.textures import READERS
from comparisons.textures.checker import FIELDS
from comparisons.textures.texture import Use
from reference_rt.textures import VertexColours


def colour_or_texture(
    reading: Reading, node: Node, key: str, default: float | Rgb, use: str = "reflectance"
) -> Rgb | str:
    """A colour, or the name of a texture of `reading`.  use: see `colour`."""
    if node.has(key) and node.kind_of(key) == "ResolvedReference":
        value = node.take(key)
        if value.kind != "Texture":
            raise node.error(f"'{key}' is a {value.kind.lower()}; expected a texture")
        if value.plugin in SPECTRA:
            return constant(value)
        if value.index in reading.fields:
            field = reading.fields[value.index]
            return colour_or_texture(reading, value, field, FIELDS[field], use)
        return texture_name(reading, value, Use())
    return colour(node, key, default, use)


def number_or_texture(reading: Reading, node: Node, key: str, default: float) -> float | str:
    """A number, or the name of a texture whose luminance it is."""
    if not node.has(key):
        return default
    kind = node.kind_of(key)
    if kind in ("Float", "Integer"):
        return node.number(key, default)
    if kind == "ResolvedReference":
        value = node.take(key)
        if value.kind != "Texture":
            raise node.error(f"'{key}' is a {value.kind.lower()}; expected a number or a texture")
        if value.index in reading.fields:
            # Mitsuba's `eval_1` exchanges the two.
            field = "color1" if reading.fields[value.index] == "color0" else "color0"
            return number_or_texture(reading, value, field, FIELDS[field])
        if value.plugin not in SPECTRA:
            return texture_name(reading, value, Use(as_number=True))
        if value.plugin in ("uniform", "rawconstant"):
            return constant(value)[0]
        return luminance(constant(value))
    return luminance(colour(node, key, default))


def projected(
    reading: Reading, node: Node, key: str, default: float | Rgb, use: str = "reflectance"
) -> Rgb | str:
    """`colour_or_texture` for a light that projects it: (0, 0) is the upper left corner of the
    image in Mitsuba, the lower left one in ours."""
    if node.has(key) and node.kind_of(key) == "ResolvedReference":
        value = node.take(key)
        if value.kind == "Texture" and value.plugin not in SPECTRA:
            return texture_name(reading, value, Use(projected=True))
        if value.kind == "Texture":
            return constant(value)
        raise node.error(f"'{key}' is a {value.kind.lower()}; expected a texture")
    return colour(node, key, default, use)


def texture_name(reading: Reading, node: Node, use: Use) -> str:
    """The name of a texture of `reading`, which is read if it is not yet."""
    as_number = use.as_number and node.plugin == "checkerboard"  # the others are read alike
    key = ("texture", node.index, as_number, use.projected)
    if key not in reading.names:
        if node.plugin not in READERS:
            raise node.unsupported("expected bitmap, checkerboard, mesh_attribute or a colour")
        with node.checking():
            texture = READERS[node.plugin](reading, node, use)
        name = reading.unused(node.name, node.plugin, reading.textures)
        reading.textures[name] = texture
        if isinstance(texture, VertexColours):
            reading.attributes[name] = node.text("name", "")
        node.finish()
        reading.names[key] = name
    return reading.names[key]
