"""The words of pbrt-v4's file format, and the names of materials and textures in a file."""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from comparisons.materials import type_of
from comparisons.media import type_of as type_of_phase
from comparisons.mitsuba.files import Files, Losses, UnwritableError
from comparisons.renderers.vocabulary import ALONG, BLACK_PARAMS, Params
from comparisons.textures import type_of as type_of_texture
from reference_rt import materials
from reference_rt.core.arrays import FloatArray
from reference_rt.core.exr import write_exr


def words(
    directive: str, *names: str, params: Params | None = None, numbers: Iterable[float] = ()
) -> str:
    """A directive with its names or numbers, and its parameters."""
    found = [directive, *map(_word, (*names, *numbers))]
    for key, value in (params or {}).items():
        several = value if isinstance(value, tuple | list) else (value,)
        found += [f'"{key}"', "[", *map(_word, several), "]"]
    return " ".join(found)


_word = partial(json.dumps, ensure_ascii=False)
"""A value of pbrt's, which are written as those of JSON."""


@dataclass
class Writing(Losses):
    """A scene being written.  lines: of textures and materials;  media: those of
    media;  names: those that are taken, by
    the part that has each;  oriented: the names of materials that need texture coordinates;
    one_sided: materials that are black from behind."""

    files: Files
    target: str = field(default="pbrt-v4", kw_only=True)
    lines: list[str] = field(default_factory=list)
    media: list[str] = field(default_factory=list)
    names: dict[tuple[str, ...], str] = field(default_factory=dict)
    oriented: set[str] = field(default_factory=set)
    one_sided: set[str] = field(default_factory=set)

    def name_for(self, *part: str) -> str:
        """A name for a part of the scene that is not taken: its last word without characters that
        need escapes."""
        plain = name = re.sub(r"[^\w .+-]", "_", part[-1]) or "_"
        number = 1
        while name in self.names.values():
            number += 1
            name = f"{plain}_{number}"
        self.names[part] = name
        return name

    # ---- materials ------------------------------------------------------------------------------

    def surface(self, name: str | None) -> tuple[str, tuple[float, ...] | None]:
        """The name of a shape's material in the file, and the radiance that its front emits."""
        material = None if name is None else self.scene.materials[name]
        if not isinstance(material, materials.Emissive):
            return self.material(name), None
        base = self.black() if material.base is None else self.material(material.base)
        if isinstance(material.radiance, str):
            with self.collected("materials", str(name)):
                raise UnwritableError("a textured radiance")
            return base, (0.0, 0.0, 0.0)
        return base, material.radiance

    def material(self, name: str | None, both_sides: bool = False) -> str:
        """The name of a material in the file, which it is written to when it is first used."""
        material = materials.Diffuse() if name is None else self.scene.materials[name]
        path = ("materials", "default" if name is None else name)
        if isinstance(material, materials.TwoSided):
            if material.back not in (None, material.base):
                with self.collected(*path):
                    raise UnwritableError("another material behind than in front")
            return self.material(material.base, True)
        one_sided = not (material.transmits or isinstance(material, materials.Wrapper))
        if one_sided and not both_sides:  # all but glass look alike from both sides in pbrt
            self.one_sided.add(path[1])
        if path not in self.names:
            params = BLACK_PARAMS
            with self.collected(*path):
                if (to_pbrt := type_of(material).to_pbrt) is None:
                    raise UnwritableError(f"a material '{material.type}'")
                params = to_pbrt(material, self, both_sides)
            self.define(params, *path)
        return self.names[path]

    def define(self, params: Params, *part: str) -> str:
        """Write a material; its name."""
        name = self.name_for(*part)
        oriented = any(k.startswith("texture ") or k in ALONG for k in params)
        if oriented or self.oriented.intersection(params.get("string materials", ())):
            self.oriented.add(name)
        self.lines.append(words("MakeNamedMaterial", name, params=params))
        return name

    def black(self) -> str:
        return self.names.get(("", "black")) or self.define(BLACK_PARAMS, "", "black")

    # ---- media ----------------------------------------------------------------------------------

    def medium(self, name: str | None) -> str:
        """The name of a medium in the file, which it is written to when it is first used; empty for
        none.  pbrt renders spectra, which it makes of our colours."""
        if name is None:
            return ""
        path = ("media", name)
        if path not in self.names:
            medium, g = self.scene.media[name], 0.0
            with self.collected(*path):
                if (asymmetry := type_of_phase(medium.phase).asymmetry) is None:
                    raise UnwritableError(f"a phase function '{medium.phase.type}'")
                g = asymmetry(medium.phase)
            sigma_t, albedo = np.array(medium.sigma_t), np.array(medium.albedo)
            params: Params = {
                "string type": "homogeneous",
                "rgb sigma_a": tuple((sigma_t * (1.0 - albedo)).tolist()),
                "rgb sigma_s": tuple((sigma_t * albedo).tolist()),
                "float scale": medium.scale,
                "float g": g,
            }
            if np.ptp(sigma_t) or np.ptp(albedo):
                self.note(
                    f"the medium '{name}' has a colour, which pbrt makes a spectrum of: light that "
                    "goes far through it has a slightly different one"
                )
            self.media.append(words("MakeNamedMedium", self.name_for(*path), params=params))
        return self.names[path]

    def interface(self, inside: str | None, outside: str | None) -> list[str]:
        """The media on the sides of a surface; none where both are as around it."""
        if inside is None and outside is None:
            return []
        return [words("MediumInterface", self.medium(inside), self.medium(outside))]

    # ---- textures -------------------------------------------------------------------------------

    def parameter(self, kind: str, key: str, value: Any) -> Params:
        """A parameter that is a value or the name of a texture.  kind: "rgb" or "float"."""
        if isinstance(value, str):
            return {f"texture {key}": self.texture(value, kind)}
        return {f"{kind} {key}": value}

    def texture(self, name: str, kind: str) -> str:
        """The name of a texture in the file.  kind: "rgb", or "float" for its luminance."""
        part = ("textures", kind, name)
        if part not in self.names:
            texture, plugin, params = self.scene.textures[name], "constant", Params()
            with self.collected("textures", name):
                if (to_pbrt := type_of_texture(texture).to_pbrt) is None:
                    raise UnwritableError(f"a texture '{texture.type}'")
                plugin, params = to_pbrt(texture, name, kind, self)
            names = (self.name_for(*part), "spectrum" if kind == "rgb" else kind, plugin)
            self.lines.append(words("Texture", *names, params=params))
        return self.names[part]

    def image(self, stem: str, texels: FloatArray) -> str:
        """The name of an image file of linear values (h, w, 3)."""
        planes = dict(zip("RGB", np.moveaxis(texels, -1, 0), strict=True))
        return self.files.write(f"{stem}.exr", lambda file: write_exr(file, planes, {}))
