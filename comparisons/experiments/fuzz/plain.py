"""A scene without what Mitsuba lacks, so that the rest of it can be compared nevertheless."""

from comparisons.experiments.fuzz.data import Data, copy_of, named_in
from comparisons.experiments.fuzz.reduce.edits import renamed, without_unused

GREY = 0.5


def without_textures(scene: Data) -> Data:
    """The scene without textures, maps of normals and materials with a grain, and seen by square
    pixels.

    Mitsuba's uv differ from ours on many shapes, where it can compare none of these.
    """
    found: Data = copy_of(scene)
    found.get("camera", {}).pop("view", None)
    textures = {*found.get("textures", {})}
    for name in [*found.get("materials", {})]:
        material = found["materials"].get(name)  # it may have gone with another one
        if material is not None and material["type"] in ("bump", "normal_map"):
            found = renamed(found, name, material["base"])
    for material in found.get("materials", {}).values():
        for field, value in material.items():
            if field != "type" and isinstance(value, str) and value in textures:
                material[field] = GREY
        if isinstance(material.get("alpha"), list):
            material["alpha"] = material["alpha"][0]
        material.pop("anisotropic", None)
    for light in found.get("lights", ()):
        for at, key in [*named_in(light)]:
            if at[key] in textures:
                at[key] = GREY
        if isinstance(light.get("texture"), float):  # a factor that need not be there
            del light["texture"]
    return without_unused(found)
