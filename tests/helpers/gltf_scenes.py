"""Small glTF files with everything that scenes of them use."""

import io
import warnings

import numpy as np
import pytest
from mesh_writers import Gltf, written
from PIL import Image

import reference_rt as rt

TEXELS = np.random.default_rng(8).integers(1, 256, (4, 3, 4), dtype=np.uint8)
"""An image with opacity, the top row first."""

SQUARE = np.float32([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
UV = np.float32([[0, 1], [1, 1], [1, 0], [0, 0]])


def png(texels=TEXELS):
    out = io.BytesIO()
    Image.fromarray(texels).save(out, "png")
    return out.getvalue()


class GltfScene(Gltf):
    """A square with texture coordinates and a material; `image` and `texture` add textures."""

    def __init__(self, **material):
        super().__init__()
        attributes = self.primitive["attributes"]
        attributes["POSITION"] = self.add(SQUARE)
        attributes["TEXCOORD_0"] = self.add(UV)
        self.primitive["indices"] = self.add(np.array([0, 1, 2, 0, 2, 3], np.uint16))
        self.material = material
        self.root |= {"materials": [material], "images": [], "textures": [], "samplers": []}
        self.primitive["material"] = 0

    def view(self, data):
        """The number of a view of bytes."""
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data += data + bytes(-len(data) % 4)
        return len(self.views) - 1

    def texture(self, image=None, **sampler):
        """The number of a new texture.  image: default TEXELS in a view."""
        default = {"bufferView": self.view(png()), "mimeType": "image/png"}
        self.root["images"].append(image or default)
        self.root["samplers"].append({"magFilter": 9728, **sampler})
        last = len(self.root["images"]) - 1
        self.root["textures"].append({"source": last, "sampler": last})
        return last

    def light(self, **fields):
        """A light, at a new node, whose number is returned."""
        extension = self.root.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {})
        lights = extension.setdefault("lights", [])
        lights.append(fields)
        extensions = {"KHR_lights_punctual": {"light": len(lights) - 1}}
        return self.node(extensions=extensions)

    def node(self, **fields):
        self.root["nodes"].append(fields)
        self.root["scenes"][0]["nodes"].append(len(self.root["nodes"]) - 1)
        return len(self.root["nodes"]) - 1


def full_scene():
    """A file with nearly everything that is read."""
    file = GltfScene(name="paint", doubleSided=True, alphaMode="MASK", alphaCutoff=0.3)
    every = {"index": file.texture(wrapS=33071)}
    turned = {"offset": [0.1, 0.2], "rotation": 0.3, "scale": [2, 3]}
    moved = {**every, "extensions": {"KHR_texture_transform": turned}}
    file.material["pbrMetallicRoughness"] = {
        "baseColorFactor": [0.9, 0.8, 0.7, 0.6],
        "baseColorTexture": moved,
        "metallicRoughnessTexture": every,
        "metallicFactor": 0.5,
    }
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 5.0}}
    file.material |= {"emissiveFactor": [1, 0.5, 0], "emissiveTexture": every}
    file.material |= {"normalTexture": {**every, "scale": 0.5}, "extensions": strength}
    file.primitive["attributes"]["COLOR_0"] = file.add(np.full((4, 3), 99, np.uint8))
    places = {"TRANSLATION": file.add(np.float32([[0, 0, 1], [0, 0, 2]]))}
    file.node(mesh=0, extensions={"EXT_mesh_gpu_instancing": {"attributes": places}})
    for kind in ("point", "directional", "spot"):
        file.light(type=kind, color=[1, 0.5, 0.25], intensity=2.0)
    file.root["cameras"] = [
        {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1, "aspectRatio": 1.5}},
        {
            "type": "orthographic",
            "orthographic": {"xmag": 2.0, "ymag": 1.0, "znear": 0.0, "zfar": 9.0},
        },
    ]
    file.node(camera=0, translation=[0, 0, 5], rotation=[0, 0, 0, 1])
    file.node(camera=1, name="flat")
    return file


def load(folder, file, form="glb", **options):
    """The scene, and what was said about it."""
    path = written(folder, getattr(file, form)(), f"model.{form}")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        scene = rt.Scene.load(path, **options)
    return scene, "\n".join(str(one.message) for one in said)


def refused(folder, file, **options):
    """The lines of the error."""
    with pytest.raises(rt.SceneError) as error:
        load(folder, file, **options)
    return [str(one) for one in (error.value, *error.value.others)]
