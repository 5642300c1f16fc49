"""Writes the tables of faults in docs/truth.md: `python docs/make_faults.py [NAME...]`.

Each fault changes the scene of every case, or its picture, as a wrong renderer or a wrong export
would. `reference_rt` renders the scene with its own samples, and the case judges the picture.
NAME: cases, areas or patterns, as for `reference-rt truth`; what the page has of others is kept.
(default: all)
"""

import json
import re
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import yaml
from docs_pages import DOCS

from comparisons.report.table import table_of
from comparisons.report.templates import check, rewrite
from comparisons.runs.provenance import ours as provenance
from comparisons.truth.case import AREAS, Case, cases, chosen
from comparisons.truth.judge import judge
from comparisons.truth.renderers import ours
from reference_rt import Scene
from reference_rt.util.files import read_text

SCENES, PAGE = DOCS.parent / "scenes" / "truth", DOCS / "truth.md"

SEEN, MISSED, ABSENT = "●", "○", "."


def scaled(value: Any, factor: float, *keys: str) -> Any:
    """A description whose numbers at these keys are multiplied by a factor."""
    if isinstance(value, list):
        return [scaled(each, factor, *keys) for each in value]
    if not isinstance(value, dict):
        return value
    return {
        k: times(v, factor) if k in keys else scaled(v, factor, *keys) for k, v in value.items()
    }


def times(value: Any, factor: float) -> Any:
    """A number or a list of them, times a factor; the name of a texture as it is."""
    if isinstance(value, list):
        return [times(each, factor) for each in value]
    return value * factor if isinstance(value, int | float) else value


def nearer(scene: Any) -> Any:
    """Parallel rays do not see that the camera has moved along them."""
    camera = scene["camera"]
    if camera["type"] == "orthographic":
        return scene
    eye, target = np.array(camera["eye"]), np.array(camera["target"])
    return scene | {"camera": camera | {"eye": (target + 0.99 * (eye - target)).tolist()}}


def shorter(scene: Any) -> Any:
    depth = max(scene["integrator"].get("max_depth", 5) - 1, 1)
    return scene | {"integrator": scene["integrator"] | {"max_depth": depth}}


def turned(scene: Any) -> Any:
    """Rectangles and disks keep their outline when they are turned about an axis within them."""
    about = {"rotate": {"axis": [1, 0, 0], "degrees": 180}}
    shapes = [
        s | {"transform": [about, *s.get("transform", [])]}
        if s["type"] in ("rectangle", "disk")
        else s
        for s in scene.get("shapes", [])
    ]
    return scene | {"shapes": shapes} if shapes else scene


OF_SCENES: dict[str, Callable[[Any], Any]] = {
    "view 1 % wider": lambda s: (
        s | {"camera": scaled(s["camera"], 1.01, "fov", "width", "view", "film_width")}
    ),
    "camera 1 % nearer to its target": nearer,
    "lamps, lights and skies 1 % brighter": lambda s: scaled(
        s, 1.01, "radiance", "intensity", "irradiance"
    ),
    "last of several lights missing": lambda s: (
        s | {"lights": s["lights"][:-1]} if len(s.get("lights", ())) > 1 else s
    ),
    "reflectances 2 % lower": lambda s: scaled(s, 0.98, "reflectance", "diffuse", "specular"),
    "index of refraction 0.5 % higher": lambda s: scaled(s, 1.005, "interior_ior"),
    "roughness 5 % higher": lambda s: scaled(s, 1.05, "alpha"),
    "one path edge too few; at most 4 where there is no limit": shorter,
    "rectangles and disks face the other way": turned,
}
"""Changes of a description; it stays as it is where the fault does not apply."""

OF_PICTURES: dict[str, Callable[[Any], Any]] = {
    "mirrored picture": lambda p: p[..., ::-1, :],
    "picture upside down": lambda p: p[..., ::-1, :, :],
    "half a pixel to the right, interpolated": lambda p: (p + np.roll(p, 1, axis=-2)) / 2.0,
    "gamma of 2.2 not undone": lambda p: np.maximum(p, 0.0) ** (1.0 / 2.2),
    "red and blue exchanged": lambda p: p[..., ::-1],
    "values above 1 cut off": lambda p: np.minimum(p, 1.0),
    "rounded to 8 bits, linear": lambda p: np.round(255.0 * p) / 255.0,
    "0.5 % darker": lambda p: 0.995 * p,
}
"""Changes of pixels (..., height, width, 3); they apply where they change the formula's picture."""

NAMES = [*OF_SCENES, *OF_PICTURES]


def signs(case: Case) -> list[str]:
    """For each fault, whether it applies to the case and is seen by it."""
    expected, path = case.compute(), SCENES / f"{case.name}.yaml"
    description = yaml.safe_load(read_text(path))
    right = ours(Scene.load(path), threads=1)
    if judge(expected, right).verdict != "right":
        raise SystemExit(f"{case.name}: is not right without a fault")
    truth, found = np.where(expected.stated[..., None], expected.pixels, 0.0), []
    for name in NAMES:
        if name in OF_SCENES:
            wrong = OF_SCENES[name](description)
            same = wrong == description
            scene = Scene.parse(json.dumps(wrong), folder=SCENES)
            pictures = right if same else ours(scene, threads=1)
        else:
            same = np.allclose(OF_PICTURES[name](truth), truth, rtol=1e-9, atol=1e-12)
            pictures = OF_PICTURES[name](right)
        seen = SEEN if judge(expected, pictures).verdict == "off" else MISSED
        found.append(ABSENT if same else seen)
    return found


def tables(matrix: Mapping[Case, list[str]]) -> list[str]:
    """A line for each fault, and the whole matrix."""
    rows = []
    for k, name in enumerate(NAMES):
        counts = {}
        for area, title in AREAS.items():
            column = [row[k] for case, row in matrix.items() if case.area == area]
            counts[title] = column.count(SEEN), len(column) - column.count(ABSENT)
        seen, applies = np.sum(list(counts.values()), axis=0)
        areas = "; ".join(f"{title} {n} of {m}" for title, (n, m) in counts.items() if m)
        rows.append((str(k + 1), name, str(applies), str(seen), areas))
    lines = table_of(("", "fault", "applies to", "seen by", "by area"), rows).markdown()
    lines += ["", "```text", " " * 22 + "".join(f"{k + 1:3}" for k in range(len(NAMES)))]
    lines += [f"{c.name:22}" + "".join(f"{s:>3}" for s in row) for c, row in matrix.items()]
    return [*lines, "```"]


def on_page(text: str) -> tuple[dict[str, list[str]], list[str]]:
    """The signs of each case that a page has, and its lines about who measured them."""
    signs = f"[{SEEN}{MISSED}{ABSENT}]"
    rows = re.findall(rf"^(\w+) +((?:{signs} *)+)$", text, re.MULTILINE)
    lines = re.findall(r"^`python docs/make_faults\.py.*CPU seconds\.$", text, re.MULTILINE)
    return {name: row.split() for name, row in rows}, lines


def main() -> None:
    """Measure, and write the tables."""
    check(PAGE, "faults")
    begun, measured = time.process_time(), {}
    for case in chosen(sys.argv[1:]):
        measured[case] = signs(case)
        print(case.name, *measured[case], flush=True)
    there, lines = on_page(read_text(PAGE))
    known = {case: measured.get(case, there.get(case.name)) for case in cases().values()}
    matrix = {case: row for case, row in known.items() if row}
    facts, seconds = provenance(), time.process_time() - begun
    where = f"{facts['machine']}, {facts['cores']} cores, {facts['date'][:10]}"
    command = " ".join(["python docs/make_faults.py", *sys.argv[1:]])
    where = f"`{command}`; {where}, {seconds:.0f} CPU seconds."
    lines = [*lines, where] if set(matrix) > set(measured) else [where]
    rewrite(PAGE, "faults", "\n".join([*tables(matrix), "", *lines, ""]))


if __name__ == "__main__":
    main()
