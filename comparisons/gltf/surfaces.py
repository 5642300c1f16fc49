"""Looks and images in glTF's terms as its parts, and the buffer that images stand in."""

import hashlib
import io
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image

from comparisons.materials import type_of
from comparisons.mitsuba.files import Losses, UnwritableError
from comparisons.renderers.vocabulary import GltfImage, GltfUv, Look, matte
from comparisons.textures import type_of as type_of_texture
from comparisons.textures.texture import grey
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.image import srgb
from reference_rt.textures import Checker, VertexColours
from reference_rt.textures.image_file import linear


class Surface(NamedTuple):
    """number: the material's;  maps: its sets of texture coordinates;  colours: those of vertices,
    if it has them;  tangents: whether it has a normal map;  follow_v: whether green is along dp/dv
    there."""

    number: int
    maps: tuple[GltfUv, ...]
    colours: VertexColours | None
    tangents: bool
    both_sides: bool
    follow_v: bool = False


class _Parts(NamedTuple):
    """A colour: the product of a constant, of images by name, and of the vertices' colours."""

    factor: FloatArray
    images: tuple[str, ...] = ()
    colours: VertexColours | None = None


@dataclass
class Surfaces(Losses):
    """The materials of a document that is being written.  data: its buffer;  lists: its parts by
    kind;  used: its extensions."""

    target: str = field(default="glTF", kw_only=True)
    data: bytearray = field(default_factory=bytearray)
    lists: dict[str, list[Any]] = field(default_factory=dict)
    used: set[str] = field(default_factory=set)
    views: dict[bytes, int] = field(default_factory=dict)
    surfaces: dict[str | None, Surface] = field(default_factory=dict)

    def add(self, where: str, value: Any) -> int:
        """The number of a value in a list of the document; equal parts of textures are one."""
        some = self.lists.setdefault(where, [])
        if where in ("images", "samplers", "textures") and value in some:
            return some.index(value)
        some.append(value)
        return len(some) - 1

    def view(self, content: bytes, **more: int) -> int:
        """The number of a view of the buffer at a multiple of four bytes; equal ones are one."""
        key = hashlib.sha256(content + repr(more).encode()).digest()
        if key not in self.views:
            view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(content)}
            self.data += content + b"\0" * (-len(content) % 4)
            self.views[key] = self.add("bufferViews", view | more)
        return self.views[key]

    # ---- materials and textures ------------------------------------------------------------------

    def surface(self, name: str | None) -> Surface:
        if name not in self.surfaces:
            self.surfaces[name] = Surface(0, (), None, False, True)
            with self.collected("materials", name or "default"):
                self.surfaces[name] = self.material(self.look(name), name or "default")
        return self.surfaces[name]

    def material(self, look: Look, name: str) -> Surface:
        maps: list[GltfUv] = []
        pbr: dict[str, Any] = {}
        found: dict[str, Any] = {"name": name, "pbrMetallicRoughness": pbr}
        base, opacity = self.parts(look.base), self.parts(look.opacity)
        tint = base.factor * look.tint
        if base.images or opacity.images:
            rgb, alpha = self.images(base.images), self.images(opacity.images)
            shape, sampler, uv = _common(*rgb, *alpha)
            colour = np.prod([one.texels for one in rgb], axis=0) if rgb else np.ones(shape)
            scale = np.prod([one.scale for one in rgb])
            codes, tint = self.coded(colour * tint, tint * scale, 1.0, name)
            if alpha:
                opacities = np.prod([grey(one.texels) for one in alpha], axis=0)
                shares = self.rounded(opacities * opacity.factor[0], name)
                codes = np.concatenate([codes, shares[..., None]], axis=2)
            pbr["baseColorTexture"] = self.texture(codes, sampler, uv, maps)
        share = 1.0 if opacity.images else float(opacity.factor[0])
        pbr["baseColorFactor"] = [*tint.tolist(), share]
        cutoff = next((self.cutoff(image) for image in opacity.images), None)
        if cutoff is not None:
            found |= {"alphaMode": "MASK", "alphaCutoff": cutoff}
        elif opacity.images or share < 1.0:
            found["alphaMode"] = "BLEND"
        rough, metal = self.parts(look.roughness), self.parts(look.metallic)
        values = {"roughnessFactor": rough, "metallicFactor": metal}
        if rough.images or metal.images:
            planes = {key: self.images(part.images) for key, part in values.items()}
            first = [one for some in planes.values() for one in some]
            shape, sampler, uv = _common(*first)
            codes = np.full(shape, 255, np.uint8)
            for k, (key, some) in enumerate(planes.items(), 1):
                if some:
                    numbers = np.prod([grey(one.texels) for one in some], axis=0)
                    numbers = numbers * values[key].factor[0]
                    root = look.of_alpha and key == "roughnessFactor"
                    codes[..., k] = self.rounded(np.sqrt(numbers) if root else numbers, name)
            pbr["metallicRoughnessTexture"] = self.texture(codes, sampler, uv, maps)
        for key, part in values.items():
            number = float(part.factor[0])
            root = look.of_alpha and key == "roughnessFactor"
            pbr[key] = 1.0 if part.images else float(np.sqrt(number)) if root else number
        if look.normals is not None:
            one = self.image(look.normals.normals)
            codes = self.rounded(one.texels, name)
            texture = self.texture(codes, one.sampler, one.uv, maps)
            found["normalTexture"] = texture | {"scale": getattr(look.normals, "scale", 1.0)}
        self.emission(look, found, maps, name)
        if look.both_sides:
            found["doubleSided"] = True
        if rough.colours or metal.colours or opacity.colours:
            raise UnwritableError("vertex colours that are no base colour")
        if look.extensions:
            found["extensions"] = found.get("extensions", {}) | look.extensions
        self.used |= found.get("extensions", {}).keys()
        number = self.add("materials", found)
        tangents = look.normals is not None
        follow_v = getattr(look.normals, "follow_v", False)
        colours = base.colours
        return Surface(number, tuple(maps), colours, tangents, look.both_sides, follow_v)

    def emission(self, look: Look, found: dict[str, Any], maps: list[GltfUv], name: str) -> None:
        shining = self.parts(look.radiance)
        factor = shining.factor
        if shining.colours:
            raise UnwritableError("vertex colours that shine")
        if shining.images:
            some = self.images(shining.images)
            _, sampler, uv = _common(*some)
            texels = np.prod([one.texels for one in some], axis=0) * factor
            scale = factor * np.prod([one.scale for one in some])
            codes, factor = self.coded(texels, scale, np.inf, name)
            found["emissiveTexture"] = self.texture(codes, sampler, uv, maps)
        strength = max(1.0, float(factor.max()))
        if factor.any():
            found["emissiveFactor"] = (factor / strength).tolist()
        if strength > 1.0:
            more = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
            found["extensions"] = more

    def parts(self, value: Any) -> _Parts:
        if not isinstance(value, str):
            return _Parts(np.array(value, dtype=np.float64) * np.ones(3))
        texture: Any = self.scene.textures[value]
        if isinstance(texture, VertexColours):
            return _Parts(np.ones(3), (), texture)
        if texture.type != "product":
            return _Parts(np.ones(3), (value,))
        some = [self.parts(name) for name in texture.of]
        colours = [part.colours for part in some if part.colours is not None]
        if colours[1:]:
            raise UnwritableError("vertex colours times vertex colours")
        factor = np.prod([part.factor for part in some], axis=0) * texture.factor
        images = tuple(name for part in some for name in part.images)
        return _Parts(factor, images, colours[0] if colours else None)

    def cutoff(self, name: str) -> float | None:
        """The opacity from which a mask is opaque; None where it may be between."""
        texture = self.scene.textures[name]
        if isinstance(texture, Checker):
            return 0.5 if {texture.first, texture.second} <= {(0.0,) * 3, (1.0,) * 3} else None
        found: float | None = getattr(texture, "cutoff", None)
        return found

    def images(self, names: tuple[str, ...]) -> list[GltfImage]:
        return [self.image(name) for name in names]

    def look(self, name: str | None) -> Look:
        """The material with this name.  Raises UnwritableError."""
        if name is None:
            return matte(Look().base)
        material = self.scene.materials[name]
        if (to_gltf := type_of(material).to_gltf) is None:
            raise UnwritableError(f"a material '{material.type}'")
        if to_gltf.nearly:
            what = f"the material '{name}' ({material.type})"
            self.note(f"{what} is only nearly so in glTF: {to_gltf.nearly}")
        return to_gltf.look(material, name, self)

    def image(self, name: str) -> GltfImage:
        texture = self.scene.textures[name]
        if (to_gltf := type_of_texture(texture).to_gltf) is None:
            raise UnwritableError(f"a texture '{texture.type}'")
        return to_gltf(texture, name, self)

    def coded(
        self, values: FloatArray, scale: FloatArray, most: float, name: str
    ) -> tuple[npt.NDArray[np.uint8], FloatArray]:
        """8-bit sRGB of colours over a factor, and the factor: `scale` where colours and factor are
        small enough, else the largest colours."""
        highest = values.max(axis=(0, 1))
        factor = scale if np.all(highest <= scale) and scale.max() <= most else highest
        divisor = np.where(factor > 0.0, factor, 1.0)
        codes = np.round(255.0 * srgb(values / divisor)).astype(np.uint8)
        self.eight_bits(np.abs(linear(codes / 255.0) * factor - values).max(), name)
        return codes, factor

    def rounded(self, values: FloatArray, name: str) -> npt.NDArray[np.uint8]:
        """8 bits of numbers from 0 to 1."""
        codes = np.round(255.0 * np.clip(values, 0.0, 1.0)).astype(np.uint8)
        self.eight_bits(np.abs(codes / 255.0 - values).max(), name)
        return codes

    def eight_bits(self, error: float, name: str) -> None:
        if error > 1e-9:
            self.note(f"a texture of '{name}' is rounded to 8 bits, by up to {error:.1g}")

    def texture(
        self,
        codes: npt.NDArray[np.uint8],
        sampler: dict[str, int],
        uv: GltfUv,
        maps: list[GltfUv],
    ) -> dict[str, int]:
        """A texture with its set of texture coordinates: those of the map `uv`."""
        stream = io.BytesIO()
        Image.fromarray(codes).save(stream, "PNG")
        source = {"bufferView": self.view(stream.getvalue()), "mimeType": "image/png"}
        number = {"source": self.add("images", source), "sampler": self.add("samplers", sampler)}
        same = [k for k, other in enumerate(maps) if other.is_like(uv)]
        if not same:
            maps.append(uv)
        which = same[0] if same else len(maps) - 1
        return {"index": self.add("textures", number), "texCoord": which}


def _common(first: GltfImage, *others: GltfImage) -> tuple[Any, dict[str, int], GltfUv]:
    """The shape, sampler and map of images that become one."""
    for one in others:
        same = one.texels.shape == first.texels.shape and one.sampler == first.sampler
        if not (same and one.uv.is_like(first.uv)):
            raise UnwritableError("textures of several sizes, filters or maps in one")
    return first.texels.shape, first.sampler, first.uv
