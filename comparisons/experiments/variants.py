"""Mitsuba's variants against each other: rays of its shapes, pictures and derivatives.

Each variant has a process of its own, `python -m comparisons.experiments.variants FOLDER`, which
does the task in FOLDER: Dr.Jit compiles for all objects that are alive, of whatever variant, and a
variant that crashes must end no other.  Rays are those of the rung `geometry`, half of them aimed
at edges, and judged as there: exact arithmetic says who is wrong, so a plugin that fails is named.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.compare.budget import Budget
from comparisons.compare.compare import budgeted
from comparisons.compare.control import NoLightError, of_seeds, smaller
from comparisons.gate.pair import Asked, pair_case
from comparisons.gate.pictures_in import from_array
from comparisons.mitsuba.backend import CUDA, FORCE, LLVM, SCALAR, choose, mitsuba, no_gpu
from comparisons.mitsuba.scene import first_hits
from comparisons.renderers import NoCounterpartError
from comparisons.results.case import Case, Images, RungResult, Status, decide
from comparisons.rungs import geometry
from comparisons.statistics import compare, standard_error
from comparisons.translator import load
from comparisons.translator.derivative import Differentiator, Moving
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceUnavailableError
from reference_rt.util.files import temporary_folder
from reference_rt.util.processes import tied

_TURN = "transform: [{rotate: {axis: [1, 2, 3], degrees: 40}}, {translate: [0.3, -0.2, 0.1]}]"
_STRETCH = _TURN.replace("[{rotate", "[{scale: [1, 1.6, 0.7]}, {rotate")

SHAPES = {
    "sphere": f"{{type: sphere, radius: 0.8, {_TURN}}}",
    "instance": f"{{type: sphere, radius: 0.8, {_STRETCH}}}",
    "rectangle": f"{{type: rectangle, {_TURN}}}",
    "disk": f"{{type: disk, {_TURN}}}",
    "cylinder": f"{{type: cylinder, capped: false, radius: 0.6, z_min: -0.6, z_max: 0.8, {_TURN}}}",
    "cube": f"{{type: box, {_TURN}}}",
    "mesh": f"{{type: cone, radius: 0.8, height: 1, {_TURN}}}",
}
"""Descriptions of ours that are these plugins in Mitsuba."""

PLUGINS = (*SHAPES, "bsplinecurve", "linearcurve", "sdfgrid")
"""All that are traced; the last ones we do not have, and variants are compared with each other."""

_SCENE = """\
camera: {type: perspective, eye: [1, 2, 5], target: [0, 0, 0], fov: 40}
film: {width: 64, height: 64}
integrator: {type: ray_cast}
"""

FEWEST_OTHERS = 0.01
"""Share of rays beyond which two variants trace a plugin differently that we do not have: on
silhouettes, and where a curve is thin, float32 decides either way."""


@dataclass(frozen=True)
class Task:
    """scenes: files;  rays: of each plugin, 0 for none;  size, spp, replicates: of pictures;
    derivatives: by scene, the path of a parameter."""

    scenes: tuple[str, ...] = ()
    rays: int = 200_000
    size: tuple[int, int] = (64, 64)
    spp: int = 16
    replicates: int = 8
    derivatives: Mapping[str, str] = field(default_factory=dict)
    plugins: tuple[str, ...] = PLUGINS

    def parts(self) -> list[str]:
        """What a process does, in its order."""
        return [
            *(f"rays {plugin}" for plugin in self.plugins if self.rays),
            *(f"picture {Path(file).stem}" for file in self.scenes),
            *(f"derivative {Path(file).stem}" for file in self.derivatives),
        ]


def works() -> tuple[list[str], list[str]]:
    """The variants that work here, and a line about each that does not."""
    found, left_out = [SCALAR], []
    for name in (LLVM, CUDA):
        try:
            problem = no_gpu() if name == CUDA else None
            if problem is None:
                choose(name)
        except ReferenceUnavailableError as error:
            problem = str(error)
        if problem is None:
            found.append(name)
        else:
            left_out.append(f"{name}: {problem}")
    return found, left_out


def run(
    variants: Sequence[str], task: Task, limit: float, say: Callable[[str], None]
) -> list[Case]:
    """The cases of each plugin in each variant, and of each scene and derivative by two."""
    with temporary_folder() as place:
        told = {name: measured(name, task, place / name, say) for name in variants}
        cases = [_of_rays(plugin, variants, told) for plugin in task.plugins if task.rays]
        for one, two in combinations(variants[::-1], 2):
            for key in task.parts():
                kind, _, name = key.partition(" ")
                is_scalar = kind == "derivative" and SCALAR in (one, two)  # which has none
                if kind in ("picture", "derivative") and not is_scalar:
                    cases.append(of_pictures(kind, name, (one, two), told, limit))
                    say(f"{cases[-1].scene}: {cases[-1].verdict}")
    return cases


def measured(variant: str, task: Task, folder: Path, say: Callable[[str], None]) -> dict[str, Any]:
    """What a process of this variant found, by what it did; arrays are read."""
    folder.mkdir()
    (folder / "task.json").write_text(json.dumps(vars(task)), encoding="utf-8")
    say(f"{variant}: rays, pictures and derivatives")
    child = subprocess.run(
        [sys.executable, "-m", __spec__.name, str(folder)],
        env={**os.environ, FORCE: variant},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        **tied(),
        check=False,
    )
    found: dict[str, Any] = {}
    told = folder / "told.jsonl"
    for line in told.read_text(encoding="utf-8").splitlines() if told.exists() else ():
        answer = json.loads(line)
        if "array" in answer:
            answer["array"] = np.load(folder / answer["array"])
        found[answer["what"]] = answer
    if child.returncode:
        last = [key for key, value in found.items() if value.get("status") == "begun"]
        how = f"ends the process with {child.returncode}: {child.stderr.strip()[-300:]}"
        for key in last or [task.parts()[0]]:  # before it began anything
            found[key] = {"status": "differ", "reason": f"{variant} {how}"}
    return found


def _of_rays(plugin: str, variants: Sequence[str], told: Mapping[str, Mapping[str, Any]]) -> Case:
    """The case of a plugin: which variant traces it wrongly."""
    answers = {name: told[name].get(f"rays {plugin}") for name in variants}
    wrong, reasons = [], []
    statuses: list[Status] = []
    first: FloatArray | None = None
    for name, answer in answers.items():
        if answer is None:
            statuses.append("not-comparable")
            reasons.append(f"{name}: was not run")
            continue
        status, reason = answer["status"], answer["reason"]
        if "array" in answer:
            first = answer["array"] if first is None else first
            apart = ~np.isclose(answer["array"], first, rtol=1e-3, atol=1e-4)
            share = float(apart.mean())
            reason = f"{100.0 * share:.2g} % of the rays have another hit than in {variants[0]}"
            status = "differ" if share > FEWEST_OTHERS else "agree"
        statuses.append(status)
        reasons.append(f"{name}: {reason}")
        if status == "differ":
            wrong.append(name)
    of: Status = next((s for s in _GRAVEST if s in statuses), "agree")
    reason = "; ".join(reasons)
    if wrong:
        reason = f"the plugin {plugin} fails in {', '.join(wrong)}: {reason}"
    rung = RungResult("geometry", of, reason)
    verdict, reason = decide([rung], None)
    sides = ("Mitsuba's", "ours")
    return Case(f"rays of {plugin}", verdict, reason, (rung,), None, {}, sides=sides)


_GRAVEST: tuple[Status, ...] = ("differ", "not-comparable", "reference-limited")


def of_pictures(
    kind: str,
    name: str,
    pair: tuple[str, str],
    told: Mapping[str, Mapping[str, Any]],
    limit: float,
) -> Case:
    one, two = (told[variant].get(f"{kind} {name}", {}) for variant in pair)
    title, sides = f"{name}: {pair[0]} against {pair[1]}", (f"{pair[0]}'s", f"{pair[1]}'s")
    if "array" in one and "array" in two and kind == "picture":
        still = min(len(one["array"]), len(two["array"])) == 1
        asked = Asked(limit, title, sides=sides, noise_free=still)
        return pair_case(from_array(one["array"]), from_array(two["array"]), asked)
    images = None
    if "array" in one and "array" in two:
        both = one["array"], two["array"]
        rung = replace(compare(*both, limit=limit, signed=True), name="derivative")
        images = Images(both[0].mean(axis=0), both[1].mean(axis=0), standard_error(*both))
    else:
        told_of = zip(pair, (one, two), strict=True)
        why = "; ".join(f"{v}: {a.get('reason', 'was not run')}" for v, a in told_of)
        fails = "differ" in (one.get("status"), two.get("status"))
        rung = RungResult(
            "statistics" if kind == "picture" else kind,
            "differ" if fails else "not-comparable",
            why,
        )
    verdict, reason = decide([rung], None)
    title = title if kind == "picture" else f"derivative of {title}"
    return Case(title, verdict, reason, (rung,), None, {}, images=images, sides=sides)


# ---- the process of a variant --------------------------------------------------------------------


def main(folder: Path) -> None:
    """Do the task, and tell of each part in `told.jsonl` when it begins and ends."""
    task = json.loads((folder / "task.json").read_text(encoding="utf-8"))
    names = iter(range(1 << 30))

    def tell(what: str, array: FloatArray | None = None, **answer: Any) -> None:
        if array is not None:
            answer["array"] = f"{next(names)}.npy"
            np.save(folder / answer["array"], array)
        with (folder / "told.jsonl").open("a", encoding="utf-8") as file:
            print(json.dumps({"what": what, **answer}), file=file)

    for plugin in task["plugins"] if task["rays"] else ():
        tell(f"rays {plugin}", status="begun", reason="was begun")
        tell(f"rays {plugin}", **_rays(plugin, task["rays"], folder))
    for file in task["scenes"]:
        name = Path(file).stem
        tell(f"picture {name}", status="begun", reason="was begun")
        tell(f"picture {name}", **_picture(file, task))
    for file, path in task["derivatives"].items():
        what = f"derivative {Path(file).stem}"
        tell(what, status="begun", reason="was begun")
        tell(what, **_derivative(file, path, task))


def _rays(plugin: str, rays: int, folder: Path) -> dict[str, Any]:
    if plugin in SHAPES:
        scene = Scene.parse(f"{_SCENE}shapes: [{SHAPES[plugin]}]")
        counterpart = load(scene)
        # It traces three times as many rays, and as many more that are aimed.
        rung = geometry(scene, scene.tables, counterpart, rays // 6, resolved=False)
        return {"status": rung.status, "reason": rung.reason}
    mi = mitsuba()
    try:
        shape = _other(plugin, folder)
        mi_scene = mi.load_dict({"type": "scene", "shape": {**shape, "id": "shape"}})
    except RuntimeError as error:
        return {"status": "not-comparable", "reason": str(error).strip()[-200:]}
    rng = np.random.default_rng(1)
    o = rng.normal(size=(rays, 3))
    o *= 4.0 / np.linalg.norm(o, axis=1, keepdims=True)
    d = rng.uniform(-0.8, 0.8, (rays, 3)) - o
    hits = first_hits(mi_scene, {"shape": 0}, o, d / np.linalg.norm(d, axis=1, keepdims=True))
    return {"status": "agree", "reason": "", "array": hits.t}


def _other(plugin: str, folder: Path) -> dict[str, Any]:
    """The dictionary of a shape that we do not have."""
    if plugin == "sdfgrid":
        x = np.stack(np.meshgrid(*3 * [np.linspace(-1.0, 1.0, 9)], indexing="ij"))
        grid = np.linalg.norm(x, axis=0)[..., None] - 0.7
        mi = mitsuba()
        place = mi.ScalarTransform4f().translate(-1.0).scale(2.0)
        return {"type": plugin, "grid": mi.TensorXf(grid.astype(np.float32)), "to_world": place}
    at = np.linspace(0.0, 5.0, 24)
    points = np.column_stack([0.7 * np.cos(at), 0.7 * np.sin(at), 0.2 * at - 0.5, 0.1 + 0.02 * at])
    np.savetxt(folder / "curve.txt", points)
    return {"type": plugin, "filename": str(folder / "curve.txt")}


def _small(file: str, task: Mapping[str, Any]) -> tuple[Scene, Any]:
    budget = Budget(size=tuple(task["size"]), spp=task["spp"], replicates=task["replicates"])
    return budgeted(Scene.load(file), budget), budget


def _picture(file: str, task: Mapping[str, Any]) -> dict[str, Any]:
    scene, budget = _small(file, task)
    try:
        found = of_seeds(smaller(scene), budget, 1)
    except (NoLightError, NoCounterpartError) as error:
        return {"status": "not-comparable", "reason": str(error)}
    return {"status": "agree", "reason": "", "array": found}


def _derivative(file: str, path: str, task: Mapping[str, Any]) -> dict[str, Any]:
    scene, _ = _small(file, task)
    try:
        moving = Moving(scene, path)
        integrator = mitsuba().load_dict(Differentiator().of(scene))
        pictures = [moving.forward(integrator, task["spp"], k) for k in range(task["replicates"])]
    except (NoCounterpartError, ReferenceUnavailableError) as error:
        return {"status": "not-comparable", "reason": str(error)}
    return {"status": "agree", "reason": "", "array": np.stack(pictures)}


if __name__ == "__main__":
    main(Path(sys.argv[1]))
