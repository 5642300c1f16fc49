"""What a worker of the fuzzer is asked for, with how much effort, and what it finds, as data."""

import json
import re
import shutil
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from reference_rt.util.files import replacing

# ---- scenes as plain data: walks, copies, and YAML of one line for each part ---------------------


Data = dict[str, Any]
"""A scene, or a part of one, as its file's data."""

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*")
_WORDS = {"true", "false", "null", "yes", "no", "on", "off", "y", "n"}


def shapes_of(scene: Data) -> Iterator[Data]:
    """All shapes of a scene's data: operands of solids and members of groups too."""
    for shape in scene.get("shapes", ()):
        yield from _with_operands(shape)
    for members in scene.get("groups", {}).values():
        for shape in members:
            yield from _with_operands(shape)


def _with_operands(shape: Data) -> Iterator[Data]:
    yield shape
    for operand in shape.get("of", ()):
        yield from _with_operands(operand)


def named_in(part: Any) -> Iterator[tuple[Data, str]]:
    """Every field of a part that is a text but for its type, at any depth, with the data that it
    belongs to: some are names of materials and textures."""
    if isinstance(part, dict):
        for key, value in part.items():
            if isinstance(value, str) and key != "type":
                yield part, key
            else:
                yield from named_in(value)
    elif isinstance(part, list):
        for value in part:
            yield from named_in(value)


def text_of(scene: Data) -> str:
    """YAML, one line for each shape, material, light and so on."""
    lines: list[str] = []
    for key, value in scene.items():
        if isinstance(value, dict) and key in ("textures", "materials", "groups"):
            if value:
                lines.append(f"{key}:")
                lines += [f"  {_flow(name)}: {_flow(part)}" for name, part in value.items()]
        elif isinstance(value, list):
            if value:
                lines.append(f"{key}:")
                lines += [f"  - {_flow(part)}" for part in value]
        else:
            lines.append(f"{key}: {_flow(value)}")
    return "\n".join(lines) + "\n"


def _flow(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_flow(k)}: {_flow(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, str):
        bare = _PLAIN.fullmatch(value) and value.lower() not in _WORDS
        return value if bare else json.dumps(value, ensure_ascii=False)
    if isinstance(value, float) and value == int(value) and abs(value) < 1e15:
        return str(int(value))
    return json.dumps(value)


def copy_of(data: Any) -> Any:
    """A deep copy of plain data."""
    if isinstance(data, dict):
        return {key: copy_of(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [copy_of(value) for value in data]
    return data


# ---- effort -------------------------------------------------------------------------------------


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
    statistics of each so many-th scene only."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    rungs: tuple[str, ...] = RUNGS
    pixels: int = 48
    light_pixels: int = 24
    spp: int = 16
    replicates: int = 8
    identity_rays: int = 240
    every: int = 2


# ---- findings -----------------------------------------------------------------------------------


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


# ---- requests -----------------------------------------------------------------------------------


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


# ---- the results of a run in its folder: a file for each scene, and for each reduced finding -----


M = TypeVar("M", Checked, Reduced)


def _file(folder: Path, kind: type[Checked] | type[Reduced], number: int | str) -> Path:
    return folder / ("findings" if kind is Reduced else "scenes") / f"{number}.json"


def add(folder: Path, one: Checked | Reduced) -> None:
    """Store what came of a scene, or a reduced finding."""
    with replacing(_file(folder, type(one), one.number)) as temporary:
        temporary.write_text(one.model_dump_json(indent=1), encoding="utf-8")


def read(folder: Path, kind: type[M], number: int) -> M | None:
    """What is stored of a scene; None where nothing is, or nothing whole."""
    with suppress(OSError, ValidationError):
        return kind.model_validate_json(_file(folder, kind, number).read_bytes())
    return None


def every(folder: Path, kind: type[M]) -> Iterator[M]:
    """All that is stored, by number."""
    files = _file(folder, kind, 0).parent.glob("*.json")
    found = (read(folder, kind, number) for number in sorted(int(file.stem) for file in files))
    yield from (one for one in found if one is not None)


def check_settings(folder: Path, settings: dict[str, object]) -> bool:
    """Whether the folder holds results of the same settings, or none; then they are stored."""
    path = folder / "settings.json"
    text = json.dumps(settings, indent=1, sort_keys=True)
    if path.exists():
        return path.read_text(encoding="utf-8") == text
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return True


def remove(folder: Path) -> None:
    """Remove the results of earlier runs."""
    (folder / "settings.json").unlink(missing_ok=True)
    for kind in (Checked, Reduced):
        shutil.rmtree(_file(folder, kind, 0).parent, ignore_errors=True)
