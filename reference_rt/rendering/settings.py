"""Settings that a render may change without another scene file: size, samples, seed, integrator."""

from typing import Any, TypeVar

from reference_rt.integrators import AnyIntegrator, Direct, RayCast, Whitted
from reference_rt.integrators import Path as PathTracing
from reference_rt.scene.model import SceneModel
from reference_rt.util.errors import SceneError

S = TypeVar("S", bound=SceneModel)

_INTEGRATORS = {"ray_cast": RayCast, "whitted": Whitted, "direct": Direct, "path": PathTracing}


def with_settings(
    scene: S,
    *,
    spp: int | None = None,
    size: tuple[int, int] | None = None,
    integrator: AnyIntegrator | str | None = None,
    seed: int | None = None,
) -> S:
    """The scene with other settings; None keeps the scene's own.

    size: width and height in pixels;  spp: samples per pixel;  integrator: a description, or a
    type's name for its defaults; another one of the scene's own type keeps the scene's settings.
    Samplers without a seed keep theirs.  Raises SceneError, whose path is the setting.
    """
    parts: dict[str, Any] = {}
    if size is not None:
        width, height = size
        parts["film"] = _changed(scene.film, "size", width=width, height=height)
    if integrator is not None and integrator != scene.integrator.type:
        chosen: Any = integrator
        if isinstance(integrator, str):
            if integrator not in _INTEGRATORS:
                known = ", ".join(_INTEGRATORS)
                message = f"expected one of {known}, got '{integrator}'"
                raise SceneError(message, ("integrator",))
            chosen = _INTEGRATORS[integrator]()
        parts["integrator"] = chosen
        if chosen.deterministic != scene.integrator.deterministic:
            parts["sampler"] = None
    scene = scene.changed(**parts)
    sampler = scene.resolved_sampler
    if spp is not None:
        sampler = _changed(sampler, "spp", spp=spp)
    if seed is not None and hasattr(sampler, "seed"):
        sampler = _changed(sampler, "seed", seed=seed)
    return scene.changed(sampler=sampler)


def _changed(part: Any, setting: str, **fields: Any) -> Any:
    """`part` with some fields changed, checked again."""
    try:
        return type(part)(
            **{name: getattr(part, name) for name in type(part).__pydantic_fields__} | fields
        )
    except SceneError as error:
        raise SceneError(error.message, (setting,)) from None
