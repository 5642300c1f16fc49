"""What scenes are made of, and how much work each is worth."""

from dataclasses import dataclass

from pydantic import BaseModel, ConfigDict

DETERMINISTIC = ("film", "geometry", "direct", "whitted", "layers")
"""Rungs without noise."""

RUNGS = ("render", "identities", *DETERMINISTIC, "statistics")
"""What a scene is put through, in this order."""


@dataclass(frozen=True)
class Grammar:
    """features: names of types and of GROUPS, of each of which every scene has one at least;
    extreme: also far, tiny and thin ones."""

    features: tuple[str, ...] = ()
    extreme: bool = False


class Effort(BaseModel):
    """rungs: some of RUNGS;  pixels: camera rays of geometry and Whitted;  light_pixels: of direct
    light;  spp, replicates: of statistics;  identity_rays: that each identity traces;  every: the
    statistics of each so many-th scene only."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    rungs: tuple[str, ...] = RUNGS
    pixels: int = 48
    light_pixels: int = 24
    spp: int = 16
    replicates: int = 8
    identity_rays: int = 240
    every: int = 2
