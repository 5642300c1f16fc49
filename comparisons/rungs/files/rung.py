"""The rung: every shape and image of a scene, and the result."""

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.geometry.flatten import maps_of
from comparisons.results.case import RungResult
from comparisons.rungs.files.description import Description, second_reading
from comparisons.rungs.files.equations import check_equation
from comparisons.rungs.files.findings import Findings, text
from comparisons.rungs.files.gltf import check_gltf
from comparisons.rungs.files.images import check_bitmap, check_environment
from comparisons.rungs.files.meshes import check_mesh
from comparisons.shapes import type_of
from reference_rt.lights import EnvironmentMap
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Mesh, Triangle
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.shape import Shape, Solid
from reference_rt.textures import Bitmap
from reference_rt.util.yaml_text import load_any

MOST_SHAPES = 200
"""Most shapes of a scene that are checked, evenly chosen: a shape takes some milliseconds."""


def files(scene: Scene) -> RungResult:
    """Compare what we hold of a scene's shapes and images with second sources."""
    findings = Findings()
    shapes = list(_shapes(scene))
    step = max(1, -(-len(shapes) // MOST_SHAPES))
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # they were issued when the scene was built
        values = _check_description(scene, findings)
        for where, shape in shapes[::step]:
            _check_shape(where, shape, scene.folder, findings)
        for name, texture in scene.textures.items():
            if isinstance(texture, Bitmap):
                check_bitmap(f"textures.{name}", texture, scene.folder, findings)
        for i, light in enumerate(scene.lights):
            if isinstance(light, EnvironmentMap):
                check_environment(f"lights[{i}]", light, scene.folder, findings)
    unread = sorted(set(findings.unread))
    numbers: dict[str, Any] = {"checked": findings.checked, "unread": unread, "values": values}
    if findings.differences:
        return RungResult("files", "differ", _first(findings), numbers)
    if not findings.checked and not values:
        return RungResult(
            "files", "not-applicable", "no file or shape has a second source", numbers
        )
    counted = {**findings.checked, "values and defaults": values}
    facts = ", ".join(f"{kind} {count:,}" for kind, count in sorted(counted.items()))
    left_out = f"; without a second source: {', '.join(unread)}"
    reason = f"as second sources say: {facts}{left_out if unread else ''}"
    return RungResult("files", "agree", reason, numbers)


def misread(scene: Scene) -> RungResult | None:
    """The rung for who only needs our numbers to be the description's: what a second reading of the
    scene's text says otherwise, None where it says nothing else."""
    findings = Findings()
    values = _check_description(scene, findings)
    if not findings.differences:
        return None
    return RungResult("files", "differ", _first(findings), {"values": values})


def _first(findings: Findings) -> str:
    more = len(findings.differences) - 1
    return findings.differences[0] + (f"; and {more} more" if more else "")


ALONE = ("camera", "film", "sampler", "integrator", "media")
"""Keys whose values refer to none of the others: the camera's is in a medium."""


def _check_description(scene: Scene, findings: Findings) -> int:
    """How many values were compared.

    An option, or Python code, may have changed a part after it was read: a difference counts only
    if what we read anew has it, too.
    """
    path, said = scene.source_file, None
    if path is not None and path.suffix.lower() in (".gltf", ".glb"):
        wrong = check_gltf(path, scene, findings)
        if wrong:
            again = type(scene).load(path, scene.defaults, scene.allows_missing)
            there = check_gltf(path, again, Findings())
            findings.differences += [one for one in wrong if one in there]
    elif scene.source_text is not None:
        try:
            said = second_reading(scene.source_text)
        except ValueError as error:
            findings.unread.append(str(error))
    found = Description(scene, said)
    wrong = found.differences
    if wrong and said is not None and scene.source_text is not None:
        ours = load_any(scene.source_text)
        if all(one.startswith(ALONE) for one in wrong):
            ours, said = ({key: of[key] for key in ALONE if key in of} for of in (ours, said))
        there = Description(type(scene).model_validate(ours), said).differences
        wrong = [one for one in wrong if one in there]
    findings.differences += wrong
    return found.values


def _shapes(scene: Scene) -> Iterator[tuple[str, Shape]]:
    """Every shape of a scene with its place: those of groups and the operands of solids, too."""
    groups = ((f"groups.{name}", shapes) for name, shapes in scene.groups.items())
    waiting = [
        (f"{place}[{i}]", shape)
        for place, shapes in (("shapes", scene.shapes), *groups)
        for i, shape in reversed(list(enumerate(shapes)))
    ]
    while waiting:
        place, shape = waiting.pop()
        if isinstance(shape, Solid):
            waiting += [(f"{place}.of[{i}]", one) for i, one in enumerate(shape.of)]
        else:
            yield f"{place} ({type(shape).__name__.lower()})", shape


def _check_shape(where: str, shape: Shape, folder: Path, findings: Findings) -> None:
    if isinstance(shape, Mesh | Triangle):
        check_mesh(where, shape, folder, findings)
    elif isinstance(shape, Instance):
        ours, theirs = shape.maps(folder), np.array(maps_of(shape, folder))
        error = np.abs(ours - theirs).max(axis=(1, 2))
        # A few products of rounded matrices.
        if (error > 2.0**-44 * np.abs(theirs).max(axis=(1, 2))).any():
            k = int(error.argmax())
            findings.differences.append(
                f"{where}: copy {k} has the map {text(ours[k])}; its description says "
                f"{text(theirs[k])}"
            )
        findings.count("instances")
    elif type_of(shape).surface is not None:
        check_equation(where, shape, findings)
    else:
        findings.unread.append(type(shape).__name__.lower())
