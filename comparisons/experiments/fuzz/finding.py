"""What a worker of the fuzzer is asked for, with how much effort, and what it finds."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field

from comparisons.experiments.fuzz.data import Data
from comparisons.mitsuba.backend import SCALAR

DETERMINISTIC = ("files", "film", "geometry", "direct", "whitted", "layers")
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
    statistics of each so many-th scene only;  variant: Mitsuba's."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    rungs: tuple[str, ...] = RUNGS
    pixels: int = 48
    light_pixels: int = 24
    spp: int = 16
    replicates: int = 8
    identity_rays: int = 240
    every: int = 2
    variant: str = SCALAR


class Finding(BaseModel):
    """rung: of the comparison, "identity NAME", "render", "run" (the process died or hung) or
    "scene" (the schema refused a generated scene);  cause: what is wrong, without the numbers of
    this scene, so that scenes with one cause have equal ones;  detail: the differing ray, pixel or
    number with both values."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    rung: str
    cause: str
    detail: str

    @property
    def key(self) -> tuple[str, str]:
        """What two findings of one cause share before they are reduced."""
        return self.rung, self.cause


class Checked(BaseModel):
    """What came of one scene.  number: of the scene;  findings: empty for a good scene;  rungs: the
    status of each rung and identity by name;  lit: whether our picture is not black;  types: those
    that occur, as "kind:name";  seconds: wall clock."""

    model_config = ConfigDict(extra="forbid")

    number: int
    findings: list[Finding] = Field(default_factory=list)
    rungs: dict[str, str] = Field(default_factory=dict)
    lit: bool = False
    types: list[str] = Field(default_factory=list)
    seconds: float = 0.0


class Reduced(BaseModel):
    """A finding whose scene was reduced.  number, finding: of the scene as it was generated, and
    what is left of it;  scene: reduced data;  tried: how many scenes it took;  pixels: camera rays
    that show it;  pictures: PNGs of both sides as data: URLs, by whose they are."""

    model_config = ConfigDict(extra="forbid")

    number: int
    finding: Finding
    scene: Data
    tried: int = 0
    pixels: int = 0
    types: list[str] = Field(default_factory=list)
    pictures: dict[str, str] = Field(default_factory=dict)
    seconds: float = 0.0

    @property
    def signature(self) -> tuple[Any, ...]:
        """Findings with equal ones are the same: rung, cause and the types that are left."""
        return *self.finding.key, *self.types


_NUMBER = re.compile(r"0x[0-9a-f]+|[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|\bnan\b|\binf\b")


def without_numbers(text: str, longest: int = 160) -> str:
    """A message with '#' in place of each number, for comparison with those of other scenes."""
    return " ".join(_NUMBER.sub("#", text).split())[:longest]


class Request(BaseModel):
    """task: "scene" generates and checks the scene `number`; "reduce" makes the scene of a finding
    smaller;  out: folder of the results;  files: of the files that scenes name;  seed, features,
    extreme: of the generator;  scene: data, in place of a generated one;  command: of another
    renderer (`renderer.py`);  seconds: of a reduction."""

    model_config = ConfigDict(extra="forbid")
    output: ClassVar[str] = "out"

    task: Literal["scene", "reduce"] = "scene"
    number: int
    out: Path
    files: Path
    seed: int = 0
    features: tuple[str, ...] = ()
    extreme: bool = False
    effort: Effort = Effort()
    scene: Data | None = None
    finding: Finding | None = None
    command: str = ""
    seconds: float = 120.0

    @property
    def grammar(self) -> Grammar:
        """What scenes are made of."""
        return Grammar(self.features, self.extreme)
