"""Images of all directions: Mitsuba's `envmap`; and its `sunsky`, which is read as one."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import polar

from comparisons.geometry import affine
from comparisons.lights.constant import leave_out_environment
from comparisons.lights.equal_area import image_of
from comparisons.lights.light import (
    Data,
    LightType,
    Motion,
    check_size,
    shows_no_image,
    similarity,
    with_steps,
)
from comparisons.lights.sunsky import read_sunsky
from comparisons.mitsuba.backend import mitsuba
from comparisons.mitsuba.context import TranslationContext, transform_steps
from comparisons.mitsuba.files import Files
from comparisons.mitsuba.node import Node, Reading
from comparisons.mitsuba.parse import as_transform
from comparisons.mitsuba.second import described_image, reads_image
from reference_rt.core.transform import is_similarity
from reference_rt.lights import EnvironmentMap
from reference_rt.textures.image_file import read_image


def _to_mitsuba(light: EnvironmentMap, context: TranslationContext) -> Data:
    if context.files is not None:
        return _in_file(light, context, context.files)
    path = context.folder / light.file
    ours = read_image(path, light.encoding, light.scale, light.layer)
    texels = described_image(path, light.encoding, light.scale, light.layer, ours)
    # Written with seven digits, a rotation is not quite one.
    to_world = np.eye(4)
    to_world[:3, :3] = polar(affine.of_steps(light.transform)[:, :3])[0]
    return {
        "type": "envmap",
        **context.image("", texels),
        "to_world": mitsuba().ScalarTransform4f(to_world),
    }


def _in_file(light: EnvironmentMap, context: TranslationContext, files: Files) -> Data:
    found: Data = {"type": "envmap", "scale": light.scale}
    path = context.folder / light.file
    if not reads_image(path, light.encoding, light.layer):
        texels = read_image(path, light.encoding, layer=light.layer)
        found |= context.image(Path(light.file).stem, texels)
    else:
        number = files.scene.lights.index(light)
        found["filename"] = files.copy(light.file, "lights", number, "file")
    if light.transform:
        found["to_world"] = transform_steps(light.transform)
    return found


def _from_mitsuba(reading: Reading, node: Node) -> EnvironmentMap:
    node.ignore("mis_compensation")  # of sampling
    if node.has("bitmap"):
        raise node.error("'bitmap', an image in memory, is not supported; expected a file")
    linear = node.transform()[:, :3]  # Mitsuba ignores a translation, too
    rotation = similarity(node, linear)
    check_size(node, linear[:, 2])
    turn: Any = ()
    if not np.array_equal(rotation, np.eye(3)):
        of_axes = np.column_stack([linear, np.zeros(3)])
        turn = as_transform(node.written(), of_axes)
        if "matrix" in turn[0] and len(turn) == 1 and not is_similarity(linear):
            turn = ({"matrix": np.column_stack([rotation, np.zeros(3)]).tolist()},)
    return EnvironmentMap(
        file=reading.relative(reading.file(node)), scale=node.number("scale", 1.0), transform=turn
    )


def _moved(light: EnvironmentMap, motion: Motion) -> EnvironmentMap:
    return with_steps(light, motion.steps) if motion.steps else light


ENVIRONMENT_MAP = LightType(
    description=EnvironmentMap,
    table=None,
    to_mitsuba=_to_mitsuba,
    from_mitsuba={"envmap": _from_mitsuba, "sunsky": read_sunsky},
    to_cycles=None,
    to_gltf=leave_out_environment,
    to_pbrt=lambda light, writing: ("infinite", {"string filename": image_of(light, writing)}),
    to_povray=None,
    moved=_moved,
    at=None,
    along=None,
    surrounds=True,
    is_bounded=False,
    projects=shows_no_image,
    brightest=lambda light: light.scale,
    float32=None,
)
