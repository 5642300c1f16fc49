"""What a worker of the fuzzer is asked for."""

from pathlib import Path
from typing import ClassVar, Literal

from pydantic import BaseModel, ConfigDict

from comparisons.experiments.fuzz.data import Data
from comparisons.experiments.fuzz.effort import Effort, Grammar
from comparisons.experiments.fuzz.finding import Finding


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
