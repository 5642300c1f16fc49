"""Mitsuba's derivatives of a picture by a parameter of our scene, in forward and in reverse mode.

Which of Mitsuba's parameters a parameter of ours moves, and how fast, is not tabulated: the scenes
of a difference (`reference_rt.rendering.derivative.difference`) are translated, and each number
that Mitsuba lists (`mitsuba.traverse`) is differenced.  So every parameter that the translation
knows has its derivative, in our unit.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any, get_args

import numpy as np

from comparisons.geometry.flatten import copies_of
from comparisons.integrators import type_of
from comparisons.mitsuba.backend import backend, mitsuba
from comparisons.mitsuba.scene import SPREAD
from comparisons.renderers import NoCounterpartError
from comparisons.results.differentiators import DifferentiatorName, Guiding
from comparisons.translator import MOST_INSTANCES, to_mitsuba
from comparisons.translator.native import MOST_TOLD, failing
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import Light, Path
from reference_rt.rendering.derivative import difference
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceUnavailableError

PROJECTIVE = ("prb_projective", "direct_projective")

SEES_DIRECT_LIGHT = 2
"""Edges of the paths of direct light."""

UNMOVED = ("sensor.near_clip", "sensor.far_clip")
"""What the translation derives from a scene's size, and what changes no picture."""


@dataclass(frozen=True)
class Differentiator:
    """An integrator of Mitsuba that differentiates;  guiding: None for Mitsuba's own choice."""

    name: DifferentiatorName = "prb"
    guiding: Guiding | None = None

    @property
    def words(self) -> str:
        return self.name + (f", guiding {self.guiding}" if self.guiding else "")

    @property
    def is_dear(self) -> bool:
        """Whether it builds an octree of edges for each picture: 8 CPU s, however few samples it
        has (Mitsuba 3.9.1, 16 x 16 pixels, a disk over a floor)."""
        return self.name in PROJECTIVE and self.guiding in (None, "octree")

    def seen_of(self, scene: Scene) -> Scene:
        """The scene as far as this integrator sees its light."""
        whole = scene.integrator
        if self.name != "direct_projective" or not isinstance(whole, Path | Light):
            return scene
        if whole.max_depth == SEES_DIRECT_LIGHT:
            return scene
        update = {"max_depth": SEES_DIRECT_LIGHT}
        return scene.changed(integrator=whole.model_copy(update=update))

    def of(self, scene: Scene) -> dict[str, Any]:
        """Its dictionary for a scene's integrator.  Raises NoCounterpartError."""
        edges = type_of(scene.integrator).edges
        if edges is None or scene.integrator.deterministic:
            kind = scene.integrator.type
            raise NoCounterpartError(f"Mitsuba has no derivative of pictures by '{kind}'")
        depth = edges(scene.integrator)
        if self.name == "direct_projective" and depth != SEES_DIRECT_LIGHT:
            raise NoCounterpartError(
                "direct_projective differentiates direct light alone; expected the scene's "
                "integrator 'direct', or max_depth 2"
            )
        found: dict[str, Any] = {"type": self.name}
        if self.name != "direct_projective":
            found["max_depth"] = -1 if depth is None else depth
            found["rr_depth"] = getattr(scene.integrator, "rr_depth", 5)
        if getattr(scene.integrator, "hide_emitters", False):
            found["hide_emitters"] = True
        if self.guiding is not None:
            if self.name not in PROJECTIVE:
                raise NoCounterpartError(f"{self.name} samples no edges, and has no guiding")
            found["guiding"] = self.guiding
        return found


DIFFERENTIATORS = tuple(
    Differentiator(name, guiding)
    for name in get_args(DifferentiatorName)
    for guiding in ((None, *get_args(Guiding)) if name in PROJECTIVE else (None,))
)
"""All that there are."""


SAMPLER = "multijitter"
"""Mitsuba's stratified one, which has the least noise of its own."""


class Moving:
    """A scene in Mitsuba, one of whose parameters moves.

    Raises NoCounterpartError where Mitsuba has no derivative, UsageError for a parameter that is
    none, ReferenceUnavailableError without a variant that differentiates, SceneError.
    """

    def __init__(self, scene: Scene, path: str) -> None:
        if not (variant := backend().variant).endswith("_ad_rgb"):
            raise ReferenceUnavailableError(
                f"Mitsuba's variant {variant} has no derivatives; expected llvm_ad_rgb "
                f"({backend().reason})"
            )
        copies = copies_of(scene)
        if any(member.tree is not None for copy in copies for member in copy.members):
            raise NoCounterpartError("Mitsuba has no set operations")
        if sum(copy.instance >= 0 for copy in copies) > MOST_INSTANCES:
            raise NoCounterpartError("Mitsuba takes minutes to compile many instances")
        self._mi_scene, here = _loaded(scene, SAMPLER)
        self._parameters = mitsuba().traverse(self._mi_scene)
        found = difference(scene, path)
        self.path = found.parameter.path
        fine, coarse = (
            _summed([_loaded(one) for one in scenes], found.weights, here)
            for scenes in (found.scenes, found.coarse)
        )
        # The coarse scenes' weights are half as large; the sum has no error of second order.
        self._speeds = {key: (4.0 * fine[key] - 0.5 * coarse[key]) / 3.0 for key in fine}
        if not self._speeds:
            raise NoCounterpartError(f"no number in Mitsuba's scene moves with {self.path}")
        self._at = {key: type(self._parameters[key])(self._parameters[key]) for key in fine}

    @cached_property
    def moved(self) -> tuple[str, ...]:
        """Mitsuba's names of what moves."""
        return tuple(self._speeds)

    def forward(self, integrator: Any, spp: int, seed: int) -> FloatArray:
        """The derivative's picture (height, width, 3), by our parameter.  Raises
        NoCounterpartError if Mitsuba refuses."""
        import drjit as dr

        with self._attached() as theta:
            picture = self._render(integrator, spp, seed)
            dr.forward(theta)
            return np.array(dr.grad(picture)).astype(np.float64)[..., :3]

    def reverse(self, integrator: Any, spp: int, seed: int, weights: FloatArray) -> float:
        """The sum over pixels and channels of weights (height, width, 3) times that picture, in
        reverse mode.  Raises as `forward` does."""
        import drjit as dr

        with self._attached() as theta:
            picture = self._render(integrator, spp, seed)
            mi = mitsuba()
            dr.backward(dr.sum(picture * mi.TensorXf(weights.astype(np.float32)), axis=None))
            return float(np.array(dr.grad(theta)).ravel()[0])

    def _render(self, integrator: Any, spp: int, seed: int) -> Any:
        mi = mitsuba()
        return mi.render(
            self._mi_scene,
            params=self._parameters,
            integrator=integrator,
            spp=spp,
            seed=SPREAD * seed % (1 << 32),
        )

    @contextmanager
    def _attached(self) -> Iterator[Any]:
        """A number, 0, by which Mitsuba's parameters are attached to ours."""
        import drjit as dr

        theta = mitsuba().Float(0.0)
        dr.enable_grad(theta)
        try:
            for key, speed in self._speeds.items():
                self._parameters[key] = _plus(self._at[key], speed, theta)
            self._parameters.update()
            yield theta
        except Exception as error:
            if not isinstance(error, RuntimeError | MemoryError) and type(error) is not Exception:
                raise  # no refusal of Mitsuba's integrators, which raise these
            told = " ".join(str(error.__cause__ or error).split())[:MOST_TOLD]
            raise NoCounterpartError(f"Mitsuba refuses: {told}") from None
        finally:
            # A scene that stays attached spoils the derivatives of the next one.
            for key, value in self._at.items():
                self._parameters[key] = value
            self._parameters.update()


def _loaded(scene: Scene, sampler: str | None = None) -> tuple[Any, dict[str, Any]]:
    """Mitsuba's scene, and the dictionary that it is made of."""
    description = to_mitsuba(scene, native=True)
    if sampler is not None:
        description["sensor"]["sampler"]["type"] = sampler
    with failing("Mitsuba cannot load the scene"):
        return mitsuba().load_dict(description, optimize=False), description


def _summed(
    loaded: list[tuple[Any, dict[str, Any]]], weights: tuple[float, ...], here: dict[str, Any]
) -> dict[str, FloatArray]:
    """The weighted sums of Mitsuba's numbers, by name, of those that move.  Raises
    NoCounterpartError where one moves that has no derivative, or that has no name."""
    mi = mitsuba()
    listed = [mi.traverse(mi_scene) for mi_scene, _ in loaded]
    names = list(listed[0].keys())
    if any(list(one.keys()) != names for one in listed):
        raise NoCounterpartError("the step changes what Mitsuba's scene is made of")
    speeds: dict[str, FloatArray] = {}
    for key in names:
        values = [found for one in listed if (found := _numbers(one[key])) is not None]
        if key in UNMOVED or not values:
            continue
        if any(value.shape != values[0].shape for value in values):
            raise NoCounterpartError(f"the step changes how many numbers {key} has")
        if all(np.array_equal(value, values[0]) for value in values):
            continue
        if listed[0].flags(key) & mi.ParamFlags.NonDifferentiable.value:
            raise NoCounterpartError(f"Mitsuba has no derivative by {key}, which moves with it")
        speeds[key] = np.asarray(sum(w * v for w, v in zip(weights, values, strict=True)))
    for _, description in loaded:
        for part in description:
            named = any(key == part or key.startswith(f"{part}.") for key in speeds)
            if not named and _differ(description[part], here.get(part)):
                raise NoCounterpartError(f"Mitsuba lists no number of {part} that moves with it")
    return speeds


def _numbers(value: Any) -> FloatArray | None:
    """A parameter's numbers; None where it has none."""
    try:
        array = np.array(value.matrix if _is_map(value) else value)
    except (TypeError, ValueError):
        return None
    return array.astype(np.float64) if array.dtype.kind == "f" else None


def _is_map(value: Any) -> bool:
    """Whether it is an affine or a projective map.  Dr.Jit's vectors have any attribute whose
    letters name coordinates, `matrix` among them."""
    mi = mitsuba()
    return isinstance(value, mi.AffineTransform4f | mi.ProjectiveTransform4f)


def _differ(one: Any, two: Any) -> bool:
    """Whether numbers of two descriptions differ.  Objects of Mitsuba's list theirs."""
    if isinstance(one, dict) and isinstance(two, dict):
        return any(_differ(value, two.get(key)) for key, value in one.items())
    if isinstance(one, int | float | list | tuple):
        return bool(one != two)
    return False


def _plus(value: Any, speed: FloatArray, theta: Any) -> Any:
    """value + speed * theta, in Mitsuba's type."""
    mi = mitsuba()
    kind = type(value)
    if _is_map(value):
        matrix = type(value.matrix)
        return kind(value.matrix + matrix(*speed.reshape(16, -1)[:, 0].tolist()) * theta)
    if kind is mi.TensorXf:
        moved = mi.Float(speed.ravel().astype(np.float32)) * theta
        return value + mi.TensorXf(moved, shape=speed.shape)
    if speed.size == 1 or kind is mi.Float:
        return value + mi.Float(speed.ravel().astype(np.float32)) * theta
    return value + kind(*speed.reshape(speed.shape[0], -1)[:, 0].tolist()) * theta
