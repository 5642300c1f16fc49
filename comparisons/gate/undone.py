"""Reads pictures as their renderer means them: its conventions are undone.

A turn and a factor are undone in the picture. A shift is not: the reference is rendered with its
view moved as far, so that no pixel is interpolated; where the reference is a picture, both are
cropped, which whole pixels allow.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from comparisons.gate.conventions import CODES, LIGHTS, RENDERERS, Changes, Known
from comparisons.gate.pictures_in import Picture
from comparisons.results.case import Case, FloatArray
from comparisons.results.headline import UP_TO
from reference_rt.cameras import Orthographic
from reference_rt.cameras.view_rectangle import CentralCamera
from reference_rt.integrators import Direct
from reference_rt.lights import Point
from reference_rt.materials import Emissive
from reference_rt.rendering.scene import Scene
from reference_rt.sampling import Grid
from reference_rt.util.errors import UsageError

NUMBERS = "numbers"
"""After a colon: the numbers of lights were copied as they stand."""


@dataclass(frozen=True)
class Undo:
    """What is taken back before candidates are compared with their reference.

    changes: what their renderer did to them;  scene: the one that they show, None where it is not
    known;  of_files: whether the reference is a picture.  Raises UsageError for what cannot be
    undone.
    """

    changes: Changes
    scene: Scene | None = None
    of_files: bool = False

    def __post_init__(self) -> None:
        changes = self.changes
        whole = float(changes.right).is_integer() and float(changes.down).is_integer()
        if self.of_files and (not whole or changes.lights):
            what = "numbers of lights" if whole else "a shift by a part of a pixel"
            raise UsageError(f"--from: {what} cannot be undone in pictures; expected --scene alone")
        if self.scene is None and changes.cosine:
            raise UsageError("--from: the cosine is that of the view's rays; expected --scene too")
        moved = changes.right or changes.down
        camera = None if self.scene is None else self.scene.camera
        central = isinstance(camera, CentralCamera)
        if moved and not self.of_files and not (central or isinstance(camera, Orthographic)):
            raise UsageError("--from: the view of this camera cannot be moved by pixels")
        if changes.cosine and not central:
            raise UsageError("--from: the rays of this camera have no cosine to its view")
        if changes.fov and not (isinstance(camera, CentralCamera) and _is_across(camera)):
            raise UsageError("--from: the view of this camera is not that of an angle across")
        if changes.unfaded and not (self.scene is not None and _one_point(self.scene)):
            raise UsageError("--from: light falls with the distance from more than one point")

    def described(self) -> Scene | None:
        """The scene whose right picture is the one that is read."""
        scene, changes = self.scene, self.changes
        if scene is None:
            return None
        if changes.lights:
            scene = scene.changed(lights=[_scaled(light, changes.lights) for light in scene.lights])
        if changes.fov:
            scene = scene.changed(camera=scene.camera.model_copy(update={"fov_axis": changes.fov}))
        if self.of_files or not (changes.right or changes.down):
            return scene
        width, height = scene.film.width, scene.film.height
        camera = scene.camera
        assert isinstance(camera, CentralCamera | Orthographic)
        l, r, b, t = camera.rectangle(width, height)
        x, y = changes.right * (r - l) / width, changes.down * (t - b) / height
        view = {"view": (l - x, r - x, b + y, t + y)}
        if isinstance(camera, Orthographic):
            return scene.changed(camera=camera.model_copy(update={**view, "width": None}))
        by_view = {**view, "fov": None, "fov_axis": None, "distance": None}
        return scene.changed(camera=camera.model_copy(update=by_view))

    def read(self, pictures: Sequence[Picture]) -> list[Picture]:
        """Candidates, turned back, without the cosine, without the rows that were moved out."""
        return [self._read(picture) for picture in pictures]

    def judge(self, references: Sequence[Picture]) -> tuple[Picture, ...]:
        """Pictures of a reference, without the rows that the candidates do not show."""
        return tuple(_of(picture, self._kept) for picture in references)

    def cropped(self, pictures: FloatArray) -> FloatArray:
        """The same of (replicates, height, width, 3)."""
        return np.stack([self._kept(picture) for picture in pictures])

    def _kept(self, p: FloatArray) -> FloatArray:
        if not self.of_files:
            return p
        return _cropped(p, -int(self.changes.right), -int(self.changes.down))

    def _read(self, picture: Picture) -> Picture:
        changes = self.changes
        steps = (-1 if turned else 1 for turned in (changes.upside_down, changes.mirrored))
        turns = tuple(slice(None, None, step) for step in steps)
        found = _of(picture, lambda p: p[turns])
        if changes.cosine:
            assert self.scene is not None
            cosine = cosines(self.scene, found.radiance.shape[:2])
            found = replace(found, radiance=found.radiance / cosine[..., None])
        if self.of_files:
            x, y = int(changes.right), int(changes.down)
            found = _of(found, lambda p: _cropped(p, x, y))
        return found

    def applied(self, picture: FloatArray) -> FloatArray:
        """What happens to a right picture (height, width, 3) of `described`: the inverse, where
        there is one."""
        if self.changes.unfaded:
            assert self.scene is not None
            picture = picture * squared_distances(self.scene)[..., None]
        if self.changes.cosine:
            assert self.scene is not None
            picture = picture * cosines(self.scene, picture.shape[:2])[..., None]
        if self.changes.codes:
            picture = CODES[self.changes.codes](picture)
        picture = picture[::-1] if self.changes.upside_down else picture
        return np.asarray(picture[:, ::-1] if self.changes.mirrored else picture)


def cosines(scene: Scene, shape: tuple[int, ...]) -> FloatArray:
    """(height, width): between the rays of pixels' centres and the direction of view."""
    camera = scene.camera
    assert isinstance(camera, CentralCamera)
    height, width = shape
    l, r, b, t = camera.rectangle(width, height)
    x = l + (r - l) * (np.arange(width) + 0.5) / width
    y = t - (t - b) * (np.arange(height) + 0.5) / height
    return np.asarray(1.0 / np.sqrt(1.0 + x**2 + y[:, None] ** 2))


def _is_across(camera: CentralCamera) -> bool:
    return camera.view is None and camera.fov_axis in (None, "x")


def squared_distances(scene: Scene) -> FloatArray:
    """(height, width): of the point light from what the pixels' centres show, 1 for nothing."""
    o, d, *_ = scene.camera_rays()
    hits = scene.intersect(o, d)
    t = np.where(hits.shape >= 0, hits.t, 0.0)
    (light,) = scene.lights
    assert isinstance(light, Point)
    squares = ((o + t[..., None] * d - np.array(light.position)) ** 2).sum(axis=-1)
    return np.where(hits.shape >= 0, squares, 1.0)


def _one_point(scene: Scene) -> bool:
    """Whether all light comes from one point to what pixels' centres show, and no further."""
    one = [light.type for light in scene.lights] == ["point"] and not _shines(scene)
    centres = isinstance(scene.sampler, Grid) and scene.sampler.spp == 1
    return one and centres and isinstance(scene.integrator, Direct)


def _shines(scene: Scene) -> bool:
    return any(isinstance(material, Emissive) for material in scene.materials.values())


def _of(picture: Picture, change: Callable[[FloatArray], FloatArray]) -> Picture:
    opacity = None if picture.opacity is None else change(picture.opacity)
    return replace(picture, radiance=change(picture.radiance), opacity=opacity)


def _cropped(p: FloatArray, x: int, y: int) -> FloatArray:
    """Without the first x columns and y rows, or the last ones where these are negative."""
    height, width = p.shape[:2]
    if abs(x) >= width or abs(y) >= height:
        raise UsageError(f"--from: the pictures are {width} x {height}; expected larger ones")
    return p[max(y, 0) : height + min(y, 0), max(x, 0) : width + min(x, 0)]


def _scaled(light: Any, factors: dict[str, float]) -> Any:
    factor = factors.get(light.type, 1.0)
    if factor == 1.0:
        return light
    name = LIGHTS[light.type]
    colour = tuple(factor * value for value in getattr(light, name))
    return light.model_copy(update={name: colour})


@dataclass(frozen=True)
class Reading:
    """How a request's pictures are read: as ours, or as those of a renderer."""

    renderer: Known | None = None
    undo: Undo = Undo(Changes())

    @classmethod
    def of(cls, text: str, scene: Scene | None, of_files: bool) -> "Reading":
        """text: NAME, NAME:numbers, or "" for ours;  scene, of_files: as of `Undo`.  Raises
        UsageError."""
        if not text:
            return cls()
        name, colon, rest = text.partition(":")
        if name not in RENDERERS or (colon and rest != NUMBERS):
            raise UsageError(
                f"--from: there is no {text}; expected one of {', '.join(RENDERERS)}, with "
                f":{NUMBERS} after it where the numbers of lights were copied as they stand"
            )
        renderer = RENDERERS[name]
        kinds = {light.type for light in scene.lights} if scene is not None else set(LIGHTS)
        changes = renderer.changes.seen(kinds if colon else ())
        if colon and not changes.lights:
            raise UsageError(
                f"--from {text}: numbers of these lights mean what ours do; expected {name} alone"
            )
        return cls(renderer, Undo(changes, scene, of_files))

    def scene(self, scene: Scene | None) -> Scene | None:
        """The one whose right picture is the one that is read."""
        return scene if self.renderer is None else self.undo.described()

    def read(self, pictures: Sequence[Picture]) -> list[Picture]:
        """Candidates."""
        return self.undo.read(pictures)

    def judge(self, references: Sequence[Picture]) -> tuple[Picture, ...]:
        """Pictures of a reference."""
        return self.undo.judge(references)

    def facts(self, text: str) -> dict[str, Any]:
        """What results.json says of it."""
        if self.renderer is None:
            return {}
        version = f"{self.renderer.title} {self.renderer.version}"
        return {"from": text, "measured": version, "undone": list(self.undo.changes.words())}

    def told(self, case: Case) -> Case:
        """A case whose reason and notes say what was undone."""
        renderer, words = self.renderer, self.undo.changes.words()
        if renderer is None:
            return case
        undone = "; ".join(words) if words else "nothing"
        notes = [f"read as {renderer.whose}, with what was undone: {undone}"]
        notes += [f"{renderer.title}: {line}; that is not undone" for line in renderer.said]
        if renderer.glass is False:
            notes.append(
                f"{renderer.title}: radiance is not divided by the square of the index in glass, "
                "which an eye or a lamp in glass shows; that is not undone"
            )
        name = next(name for name, one in RENDERERS.items() if one is renderer)
        notes.append(f"{renderer.title}: measured by python docs/measure_conventions.py {name}")
        reason = f"{UP_TO}what was undone as {renderer.whose} ({undone}): {case.reason}"
        return replace(case, reason=reason if words else case.reason, notes=(*notes, *case.notes))
