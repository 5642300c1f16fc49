"""three.js and Babylon.js: pages in headless Chromium.

It needs Chromium, Playwright, and a folder of packages, NODE_MODULES or examples/three/node_modules,
with three or babylonjs by npm.  The gate's own browser answers the pages' requests.
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
    said = f"<!doctype html><meta charset=utf-8>\n{PAGES[name]}"
    said = said.replace("SCENE", json.dumps(_plain(name, scene)))
    (folder / "page.html").write_text(said, encoding="utf-8")
    with sync_playwright() as playwright:
        browser = launched(playwright.chromium)
        page = opened(browser, folder, None)
        logged: list[str] = []
        page.on("console", lambda message: logged.append(message.text))
        page.goto(f"{HOST}/page.html")
        page.evaluate(READY)
        picture = rendered(page, {}, codes=False)
        browser.close()
    if os.environ.get("VERBOSE"):
        print(*logged, sep="\n")
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


THREE = """<script type=importmap>{"imports": {
  "three": "/packages/three/build/three.module.js", "three/addons/": "/packages/three/examples/jsm/"}}</script>
<script type=module>
import * as THREE from "three";
import { Reflector } from "three/addons/objects/Reflector.js";
import { RectAreaLightUniformsLib } from "three/addons/lights/RectAreaLightUniformsLib.js";
const said = SCENE, scene = new THREE.Scene(), { width, height } = said;
const vector = (v) => new THREE.Vector3(...v), linear = (c) => new THREE.Color().setRGB(...c);
const renderer = new THREE.WebGLRenderer();
renderer.shadowMap.enabled = true;
renderer.shadowMap.type = THREE.BasicShadowMap;
renderer.setSize(width, height, false);
const camera = new THREE.PerspectiveCamera(said.fov, width / height, 0.1, 100);
camera.lookAt(0, 0, -1);
RectAreaLightUniformsLib.init();
const areas = said.things.some((one) => one.lights);
const matte = (color) => areas
  ? new THREE.MeshPhysicalMaterial({ color, roughness: 1, specularIntensity: 0 })
  : new THREE.MeshLambertMaterial({ color });
const looks = {
  diffuse: (one) => matte(linear(one.reflectance)),
  emissive: (one) => new THREE.MeshBasicMaterial({ color: linear(one.radiance) }),
  phong: (one) => new THREE.MeshPhongMaterial(
    { color: linear(one.diffuse), specular: linear(one.specular), shininess: one.exponent }),
};
for (const one of said.things) {
  let place = new THREE.Matrix4(), shape;
  if (one.corners) {
    const [a, b, , d] = one.corners.map(vector), x = b.clone().sub(a), y = d.clone().sub(a);
    const middle = a.clone().addScaledVector(x, 0.5).addScaledVector(y, 0.5);
    const normal = x.clone().cross(y).normalize();
    place.makeBasis(x.clone().normalize(), y.clone().normalize(), normal).setPosition(middle);
    shape = new THREE.PlaneGeometry(x.length(), y.length());
    if (one.lights) {
      const lamp = new THREE.RectAreaLight(linear(one.radiance), 1, x.length(), y.length());
      lamp.position.copy(middle);
      lamp.lookAt(middle.clone().add(normal));
      scene.add(lamp);
      continue;
    }
  } else {
    shape = new THREE.SphereGeometry(one.radius, 256, 128);
    place.setPosition(vector(one.center));
  }
  // Finer than the picture: what it interpolates are parts of pixels.
  const size = { textureWidth: 16 * width, textureHeight: 16 * height, multisample: 0 };
  const mesh = one.kind === "mirror" ? new Reflector(shape, size) : new THREE.Mesh(shape, looks[one.kind](one));
  mesh.applyMatrix4(place);
  mesh.castShadow = mesh.receiveShadow = true;
  scene.add(mesh);
}
for (const one of said.lamps) {
  const point = one.kind === "point";
  const lamp = point ? new THREE.PointLight(linear(one.intensity), 1)
    : one.kind === "spot" ? new THREE.SpotLight(linear(one.intensity), 1, 0, Math.PI / 6, 0.2)
    : new THREE.DirectionalLight(linear(one.irradiance), 1);
  lamp.position.copy(vector(one.position ?? one.origin ?? one.direction.map((x) => -x)));
  if (one.target) { lamp.target.position.copy(vector(one.target)); scene.add(lamp.target); }
  if (point) {
    lamp.castShadow = true;
    lamp.shadow.mapSize.set(2048, 2048);
    lamp.shadow.camera.near = 0.1;
    lamp.shadow.bias = -0.0005;
  }
  scene.add(lamp);
}
window.render = async () => {
  const target = new THREE.WebGLRenderTarget(width, height, { type: THREE.FloatType });
  renderer.setRenderTarget(target);
  renderer.render(scene, camera);
  const pixels = new Float32Array(4 * width * height);
  renderer.readRenderTargetPixels(target, 0, 0, width, height, pixels);
  return { width, height, pixels, bottomUp: true };
};
</script>
"""

BABYLON = """<canvas id=canvas></canvas><script src=/packages/babylonjs/babylon.js></script><script>
const said = SCENE, { width, height } = said, B = BABYLON;
const canvas = document.getElementById("canvas");
canvas.width = width; canvas.height = height;
const engine = new B.Engine(canvas, false), scene = new B.Scene(engine);
const vector = (v) => new B.Vector3(...v), linear = (c) => new B.Color3(...c);
const camera = new B.TargetCamera("c", B.Vector3.Zero(), scene);
camera.setTarget(new B.Vector3(0, 0, -1));
camera.fov = said.fov * Math.PI / 180; camera.minZ = 0.1; camera.maxZ = 100;
scene.clearColor = new B.Color4(0, 0, 0, 1);

const meshes = [], mirrors = [], blockers = [];
for (const one of said.things) {
  // Lights fade with the square of the distance on this kind of material alone.
  const fades = one.kind === "diffuse" && said.lamps.some((lamp) => lamp.kind !== "directional");
  const look = new B[fades ? "PBRMaterial" : "StandardMaterial"]("m", scene);
  look.backFaceCulling = false;
  if (fades) {
    look.metallic = 0; look.roughness = 1; look.metallicF0Factor = 0; look.albedoColor = linear(one.reflectance);
    look.brdf.baseDiffuseModel = B.Constants.MATERIAL_DIFFUSE_MODEL_LAMBERT;
  }
  // PBR's output is encoded for displays otherwise; the other's has no encoding, and would be decoded.
  scene.imageProcessingConfiguration.applyByPostProcess = fades;
  look.diffuseColor = linear(one.diffuse ?? one.reflectance ?? [0, 0, 0]);
  look.specularColor = linear(one.specular ?? [0, 0, 0]);
  look.specularPower = one.exponent ?? 64;
  if (one.kind === "emissive") { look.emissiveColor = linear(one.radiance); look.disableLighting = true; }
  let mesh;
  if (one.corners) {
    const data = new B.VertexData(), [a, b, , d] = one.corners.map(vector);
    const n = B.Vector3.Cross(b.subtract(a), d.subtract(a)).normalize();
    mesh = new B.Mesh("s", scene);
    data.positions = one.corners.flat(); data.indices = [0, 1, 2, 0, 2, 3];
    data.normals = [n, n, n, n].flatMap((v) => [v.x, v.y, v.z]);
    data.applyToMesh(mesh);
    if (one.kind === "mirror") {
      const mirror = new B.MirrorTexture("t", { width: 16 * width, height: 16 * height }, scene, false, B.Constants.TEXTURETYPE_FLOAT);
      mirror.mirrorPlane = B.Plane.FromPositionAndNormal(a, n.scale(-1));
      look.diffuseColor = B.Color3.Black();
      look.reflectionTexture = mirror;
      mirrors.push(mirror);
    }
  } else {
    mesh = B.MeshBuilder.CreateSphere("s", { diameter: 2 * one.radius, segments: 96 }, scene);
    mesh.position = vector(one.center);
    blockers.push(mesh);
  }
  mesh.material = look;
  meshes.push(mesh);
}
for (const mirror of mirrors) mirror.renderList = meshes.filter((one) => one.material.reflectionTexture !== mirror);
for (const one of said.lamps) {
  const at = vector(one.position ?? one.origin ?? one.direction);
  const lamp = one.kind === "point" ? new B.PointLight("l", at, scene)
    : one.kind === "spot" ? new B.SpotLight("l", at, vector(one.target).subtract(at).normalize(), Math.PI / 3, 0, scene)
    : new B.DirectionalLight("l", at, scene);
  if (one.kind === "point") {
    const shadow = new B.ShadowGenerator(1024, lamp);
    for (const mesh of blockers) shadow.addShadowCaster(mesh);
    for (const mesh of meshes) mesh.receiveShadows = true;
    lamp.shadowMinZ = 0.1; lamp.shadowMaxZ = 20; shadow.bias = 0.0005;
  }
  lamp.diffuse = lamp.specular = linear(one.intensity ?? one.irradiance);
}
window.render = async () => {
  const target = new B.RenderTargetTexture("t", { width, height }, scene, false, true, B.Constants.TEXTURETYPE_FLOAT);
  target.renderList = meshes; target.activeCamera = camera; target.samples = 1;
  target.clearColor = scene.clearColor;
  scene.customRenderTargets.push(target);
  await scene.whenReadyAsync();
  for (let k = 0; k < 3; k++) { scene.render(); await new Promise((go) => setTimeout(go, 50)); }
  const pixels = new Float32Array((await target.readPixels()).buffer);
  return { width, height, pixels, bottomUp: true };
};
</script>
"""

PAGES = {"three": THREE, "babylon": BABYLON}
