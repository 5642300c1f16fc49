"""three.js and Babylon.js: pages in headless Chromium.

It needs Chromium, Playwright, and a folder of packages with three or babylonjs by npm:
NODE_MODULES, else examples/three/node_modules.  The gate's own browser answers the pages' requests.
"""

import json
import math
import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from words import Array, HasNoneError, Words, lights, look, quads, rgb, size

EXAMPLE = Path(__file__).parents[1] / "examples" / "three" / "node_modules"

FILES = {"three": ("three/build", "three/examples/jsm"), "babylon": ("babylonjs",)}
"""What a page loads, below the folder of packages."""


def packages() -> Path:
    return Path(os.environ.get("NODE_MODULES", EXAMPLE))


def three(scene: Words, folder: Path, seeds: Sequence[int], spp: int) -> Iterator[Array]:
    yield _drawn("three", scene, folder)


def babylon(scene: Words, folder: Path, seeds: Sequence[int], spp: int) -> Iterator[Array]:
    if {"emissive", "diffuse"} <= {look(scene, shape)[0] for shape in scene["shapes"]}:
        raise HasNoneError("Babylon.js loads the tables of its area lamps from a server")
    yield _drawn("babylon", scene, folder)


def _drawn(name: str, scene: Words, folder: Path) -> Array:
    """Of memory, whose first row is the bottom: turned, as a canvas shows it."""
    from playwright.sync_api import sync_playwright

    from comparisons.gate.browser import HOST, READY, launched, opened, rendered

    for part in FILES[name]:
        (folder / "packages" / part).parent.mkdir(parents=True, exist_ok=True)
        shutil.copytree(packages() / part, folder / "packages" / part)
    said = Path(__file__).with_name(f"{name}.html").read_text(encoding="utf-8")
    said = said.replace("SCENE", json.dumps(_plain(name, scene)))
    (folder / "page.html").write_text(said, encoding="utf-8")
    with sync_playwright() as playwright:
        browser = launched(playwright.chromium)
        page = opened(browser, folder, None)
        page.goto(f"{HOST}/page.html")
        page.evaluate(READY)
        picture = rendered(page, {}, codes=False)
        browser.close()
    return np.asarray(picture[..., :3], float)


MATERIALS = ("diffuse", "emissive", "mirror", "phong")
"""What they have without rays: glass bends a picture of what is behind it, once."""


def _plain(name: str, scene: Words) -> Words:
    """Balls, squares with their corners, and lamps: what a page makes of them is short."""
    width, height, _, y = size(scene)
    things = []
    kinds = {look(scene, shape)[0] for shape in scene["shapes"]}
    for shape in scene["shapes"]:
        kind, m = look(scene, shape)
        if kind not in MATERIALS:
            raise HasNoneError(f"{name} traces no rays, which a {kind} takes")
        colours = {key: rgb(m[key]) for key in m.keys() - {"type", "exponent", "half_vector"}}
        if kind == "phong":  # without 1/π, and these have matte colours with it
            colours = {key: (math.pi * np.array(c)).tolist() for key, c in colours.items()}
        one: Words = {"kind": kind, "exponent": m.get("exponent"), **colours}
        one |= {key: shape[key] for key in ("center", "radius") if key in shape}
        if shape["type"] != "sphere":
            one["corners"] = np.round(quads(shape)[0], 12).tolist()
            one["lights"] = kind == "emissive" and "diffuse" in kinds
        things.append(one)
    lamps = []
    for kind, light in lights(scene):
        colours = {key: rgb(light[key]) for key in light.keys() & {"intensity", "irradiance"}}
        lamps.append({"kind": kind, **light, **colours})
    if any(lamp["kind"] == "constant" for lamp in lamps):
        raise HasNoneError(f"{name} has no even sky without a picture of it")
    fov = 2.0 * float(np.degrees(np.arctan(y)))
    return {"width": width, "height": height, "fov": fov, "things": things, "lamps": lamps}
