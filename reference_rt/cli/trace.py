"""`reference-rt trace`: the rays of one sample of a pixel, as text, as JSON and as a page.

The page draws them over three views of the scene along the axes.  There every surface is
translucent, so that the inside of a closed room is seen.
"""

import base64
import json
import math
from collections.abc import Iterable, Iterator
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from reference_rt.core.arrays import FloatArray
from reference_rt.integrators import RayCast
from reference_rt.rendering.picture import Picture
from reference_rt.rendering.ray_tree import SHADOW, ray_trees
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build_media import boundaries
from reference_rt.util.errors import UsageError, printable
from reference_rt.util.files import replacing

Tree = dict[str, Any]


def traced(scene: Scene, pixel: str, sample: int) -> Tree:
    """The rays of a sample, and what names them.  pixel: "x,y".  Raises UsageError, SceneError."""
    film = scene.film
    x, comma, y = pixel.partition(",")
    if not (comma and x.strip().isdecimal() and y.strip().isdecimal()):
        raise UsageError(f"--pixel: expected X,Y, such as 12,34, got '{pixel}'")
    column, row = int(x), int(y)
    if column >= film.width or row >= film.height:
        raise UsageError(
            f"--pixel: {pixel} is outside of the picture; expected X below {film.width} and Y "
            f"below {film.height}"
        )
    casts = isinstance(scene.integrator, RayCast)
    spp = 1 if casts else scene.resolved_sampler.spp
    if sample >= spp:
        raise UsageError(f"--sample: there are {spp}; expected at most {spp - 1}, got {sample}")
    return {
        "scene": scene.name,
        "integrator": scene.integrator.type,
        "size": [film.width, film.height],
        "pixel": [column, row],
        "sample": sample,
        "spp": spp,
        **ray_trees(scene, [(column, row, sample)])[0],
    }


def as_json(tree: Tree) -> str:
    """The tree as JSON text; numbers that are not finite, which JSON lacks, are words."""
    return json.dumps(_finite(tree), indent=1, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_finite(one) for one in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


# ---- as text -------------------------------------------------------------------------------------


def heading(tree: Tree) -> list[str]:
    """What the tree is of, and its value."""
    (x, y), (width, height) = tree["pixel"], tree["size"]
    terms = sum(len(ray["adds"]) for ray in tree["rays"])
    return [
        f"{tree['scene']}: pixel {x},{y} of {width} x {height}, sample {tree['sample']} of "
        f"{tree['spp']}, {tree['integrator']}",
        f"value {_numbers(tree['value'])}: the sum of {terms} terms, times the filter's weight "
        f"{tree['filter_weight']:.6g}"
        + (f" and the exposure {tree['exposure']:.6g}" if tree["exposure"] != 1.0 else ""),
    ]


def lines_of(scene: Scene, ray: dict[str, Any]) -> Iterator[str]:
    """What is said of a ray, line by line."""
    rows, media = [*boundaries(scene)], [*scene.media]
    numbers = dict(ray["numbers"])
    to = f" to {_light(scene, numbers.pop('light'))}" if "light" in numbers else ""
    yield f"{ray['kind']} ray{to}, weight {_numbers(ray['weight'])}"
    yield f"from {_numbers(ray['o'])} along {_numbers(ray['d'])}"
    if ray["kind"] == SHADOW:
        yield "occluded" if ray["occluded"] else "not occluded"
    elif ray.get("is_scattered"):
        where = f"at {_numbers(ray['end'])}, t {ray['t']:.6g}"
        yield f"is scattered by the medium '{media[ray['medium']]}', {where}"
    elif ray["hit"] is None:
        yield "hits nothing"
    else:
        hit = ray["hit"]
        shape, material = scene.shapes[hit["shape"]].type, hit["material"]
        named = rows[material].material
        name = "default material" if named is None else f"material '{named}'"
        copy = f", copy {hit['instance']}" if hit["instance"] >= 0 else ""
        yield (
            f"hits shapes[{hit['shape']}], {shape}{copy}, {name}, at {_numbers(hit['p'])}, "
            f"t {ray['t']:.6g}, normal {_numbers(hit['n'])}"
        )
    for what, value in ray["adds"]:
        yield f"adds {_numbers(value)}: {what}"
    if numbers:
        yield ", ".join(f"{name} {value:.6g}" for name, value in numbers.items())
    steps = f"nodes of the hierarchy: {len(ray['steps'])}; " if ray["steps"] else ""
    yield f"{steps}primitives tested: {ray['tests']}"


def _light(scene: Scene, number: int) -> str:
    found = scene.light_sources()
    shape, light = int(found.shape[number]), int(found.light[number])
    return f"shapes[{shape}]" if light < 0 else f"lights[{light}], {scene.lights[light].type}"


def _numbers(values: Iterable[float]) -> str:
    return f"({', '.join(f'{x:.6g}' for x in values)})"


def print_tree(scene: Scene, tree: Tree) -> None:
    """Print the tree on standard output."""
    from rich.console import Console
    from rich.text import Text
    from rich.tree import Tree as Drawn

    root = Drawn(Text("\n".join(heading(tree))))
    nodes: dict[int | None, Drawn] = {None: root}
    for number, ray in enumerate(tree["rays"]):
        text = printable("\n".join(lines_of(scene, ray)), kept="\n")
        nodes[number] = nodes[ray["parent"]].add(Text(text))
    Console().print(root)


# ---- as a page -----------------------------------------------------------------------------------

_SIDE = 300
"""Pixels of a view, and the unit of its drawing."""

_AXES = {
    "front: x to the right, y up": ((1, 0, 0), (0, 1, 0)),
    "from above: x to the right, z down": ((1, 0, 0), (0, 0, -1)),
    "from the right: z to the left, y up": ((0, 0, -1), (0, 1, 0)),
}
"""Views: the directions in the world that are right and up."""

_COLOURS = {
    "camera": "#222",
    "mirrored": "#06c",
    "refracted": "#084",
    "scattered": "#b0f",
    "shadow": "#d80",
}

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 1rem auto; max-width: 1240px; padding: 0 1rem;
  color: #222; background: #fff; overflow-wrap: anywhere }
.row { display: flex; flex-wrap: wrap; gap: 1rem } figure { margin: 0; flex: 1 1 260px }
svg { width: 100%; border: 1px solid #ccc } line { stroke-width: 1.5 }
rect { display: none; fill: #06c1; stroke: #06c; stroke-width: 0.5 } rect.on { display: inline }
line.on { stroke-width: 4 } li > div { cursor: pointer } li > div.on { background: #ffd }
ul { padding-left: 1.2rem; border-left: 1px solid #ccc; list-style: none } small { color: #555 }
"""

_SCRIPT = """
for (const item of document.querySelectorAll("li > div")) item.onclick = () => {
  for (const one of document.querySelectorAll(".on")) one.classList.remove("on");
  for (const one of document.querySelectorAll(`[data-ray="${item.dataset.ray}"]`))
    one.classList.add("on");
};
"""


def write_page(scene: Scene, tree: Tree, path: Path) -> None:
    """Write the page, a file without others.  Raises ImageError."""
    title, value = (escape(printable(one)) for one in heading(tree))
    legend = ", ".join(f'<b style="color:{colour}">{kind}</b>' for kind, colour in _COLOURS.items())
    page = f"""<!doctype html><html lang="en"><meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>{title}</title><style>{_STYLE}</style>
<h1>{title}</h1><p>{value}.</p>
<div class="row">{"".join(_views(scene, tree))}</div>
<p>Rays: {legend}; dashed where a shadow ray is occluded. Click on a ray below: it is emphasised,
and the nodes of the hierarchy whose boxes it meets are drawn.</p>
{_list(scene, tree, None)}
<h2>What the hierarchy saves</h2><div class="row">{"".join(_pictures(scene, tree))}</div>
<script>{_SCRIPT}</script></html>
"""
    with replacing(path) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _list(scene: Scene, tree: Tree, parent: int | None) -> str:
    """The rays that begin where another ends, as nested lists."""
    items = [
        f'<li><div data-ray="{number}">'
        + "<br>".join(escape(printable(line)) for line in lines_of(scene, ray))
        + f"</div>{_list(scene, tree, number)}</li>"
        for number, ray in enumerate(tree["rays"])
        if ray["parent"] == parent
    ]
    return f"<ul>{''.join(items)}</ul>" if items else ""


def _views(scene: Scene, tree: Tree) -> Iterator[str]:
    """The scene in a cube around what the camera sees and all ends of rays, with the rays, along
    each axis."""
    rays = tree["rays"]
    # Without the eye, which is often far away.
    ends = [ray["end"] for ray in rays if ray["end"] is not None] or [scene.camera.target]
    seen = _seen(scene)
    low = np.min([*ends, *np.quantile(seen, 0.02, axis=0, keepdims=True)], axis=0)
    high = np.max([*ends, *np.quantile(seen, 0.98, axis=0, keepdims=True)], axis=0)
    distance = float(np.linalg.norm(np.subtract(ends[0], rays[0]["o"])))
    center, half = 0.5 * (low + high), max(0.6 * float((high - low).max()), 0.1 * distance)
    for name, axes in _AXES.items():
        right, up = np.array(axes, dtype=np.float64)

        def place(p: Any, right: FloatArray = right, up: FloatArray = up) -> tuple[float, float]:
            x, y = (np.subtract(p, center) @ right / half, np.subtract(p, center) @ up / half)
            return round(0.5 * _SIDE * (1.0 + x), 2), round(0.5 * _SIDE * (1.0 - y), 2)

        boxes, lines = [], []
        for number, ray in enumerate(rays):
            data = f'data-ray="{number}"'
            for box in [box for _, box in ray["steps"] if box is not None and max(box) < math.inf]:
                (x0, y0), (x1, y1) = place(box[:3]), place(box[3:])
                corner, size = f'x="{min(x0, x1)}" y="{min(y0, y1)}"', (abs(x1 - x0), abs(y1 - y0))
                boxes.append(f'<rect {data} {corner} width="{size[0]}" height="{size[1]}"/>')
            direction = np.array(ray["d"]) / np.linalg.norm(ray["d"])
            end = ray["end"] if ray["end"] is not None else ray["o"] + 2.0 * half * direction
            (x0, y0), (x1, y1) = place(ray["o"]), place(end)
            dashes = ' stroke-dasharray="4 4"' if ray.get("occluded") else ""
            span = f'x1="{x0}" y1="{y0}" x2="{x1}" y2="{y1}"'
            lines.append(f'<line {data} stroke="{_COLOURS[ray["kind"]]}"{dashes} {span}/>')
        view = Picture({"colour": _translucent(scene, center, half, right, up)}, "colour")
        yield _figure(view.png(exposure=1.0), _SIDE, _SIDE, "".join(boxes + lines), name)


def _seen(scene: Scene) -> FloatArray:
    """(n, 3): points that the camera sees, but for the farthest; the target if it sees none."""
    x, y = (np.mgrid[0:16, 0:16] + 0.5) / 16.0
    rays = scene.camera_rays(np.stack([x * scene.film.width, y * scene.film.height], axis=-1))
    hits = scene.intersect(rays.origins, rays.directions)
    near = hits.t <= 4.0 * np.median(hits.t)
    points = hits.p[near & np.isfinite(hits.t)]
    return points if len(points) else np.array([scene.camera.target], dtype=np.float64)


def _figure(image: bytes, width: int, height: int, drawn: str, caption: str) -> str:
    """A PNG with what is drawn on it."""
    url = f"data:image/png;base64,{base64.b64encode(image).decode()}"
    return (
        f'<figure><svg viewBox="0 0 {width} {height}"><image href="{url}" width="{width}" '
        f'height="{height}" preserveAspectRatio="none"/>{drawn}</svg>'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _translucent(
    scene: Scene, center: FloatArray, half: float, right: FloatArray, up: FloatArray
) -> FloatArray:
    """(_SIDE, _SIDE, 3) light through a cube along an axis: the more a surface is seen edge-on,
    the darker it is."""
    at = (np.arange(_SIDE) + 0.5) * (2.0 / _SIDE) - 1.0
    x, y = np.meshgrid(at, -at)
    towards = np.cross(right, up)
    o = center + half * (x[..., None] * right + y[..., None] * up + towards)
    found = scene.crossings(o.reshape(-1, 3), -towards, t_max=2.0 * half)
    opacity = 0.15 + 0.6 * (1.0 - np.abs(found.n @ towards)) ** 3
    light = np.zeros(_SIDE * _SIDE)
    np.add.at(light, found.ray, np.log1p(-opacity))
    return np.repeat(np.exp(light).reshape(_SIDE, _SIDE, 1), 3, axis=2)


def _pictures(scene: Scene, tree: Tree) -> Iterator[str]:
    """The picture without light, and what each of its rays costs, with the pixel marked."""
    layers = ("bvh_steps", "intersections")
    (width, height), (x, y) = tree["size"], tree["pixel"]
    scale = min(1.0, 320.0 / max(width, height))
    film = scene.film.model_copy(update={"layers": layers})
    casting = scene.changed(integrator=RayCast(), sampler=None, film=film)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    picture = render(casting, size=size)
    shapes = scene.tables.geometry.shapes
    count = sum(len(table.face) for table in shapes if table is not None)
    words = {
        "colour": "the scene without light",
        "bvh_steps": "nodes of the hierarchy that each pixel's ray is tested against",
        "intersections": f"primitives, of {count:,}, that each pixel's ray is tested against",
    }
    radius = 0.02 * max(width, height)
    mark = (
        f'<circle cx="{x + 0.5}" cy="{y + 0.5}" r="{radius:.2f}" fill="none" stroke="#f0f" '
        f'stroke-width="{0.3 * radius:.2f}"/>'
    )
    for name, text in words.items():
        values = picture.layers[name]
        numbers = "" if name == "colour" else f": mean {values.mean():.4g}, most {values.max():g}"
        yield _figure(picture.png(name), width, height, mark, text + numbers)
