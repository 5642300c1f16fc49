#!/usr/bin/env bash
# Tone mapping by one name: a grey of 0.18 is 127 (of 255) by ACESFilmicToneMapping of three.js 0.187.0, 92 by TONEMAPPING_ACES of
# Babylon.js 9.35.0, and 91 by "ACES 1.0 - SDR Video" of OpenColorIO 2.6.0's own configuration for an sRGB display. three.js
# divides by 0.6 first: with toneMappingExposure = 0.6, which cancels that, it is 91, too.
# Without tone mapping Babylon.js encodes by the power of 1 / 2.2, three.js by sRGB's curve: 0.05 is 65, and 63.
# Seen on 2026-11-29. It needs Chromium (apt install chromium); the page is served to it alone, by Playwright.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check playwright==1.65.2 opencolorio==2.6.0 numpy==2.4.6
npm install --silent --no-audit --no-fund three@0.187.0 babylonjs@9.35.0
cat > page.html <<'END_OF_PAGE'
<script src="/node_modules/babylonjs/babylon.js"></script>
<script type=importmap>{"imports": {"three": "/node_modules/three/build/three.module.js"}}</script>
<script type=module>
import * as THREE from "three";
const n = 16, renderer = new THREE.WebGLRenderer({ preserveDrawingBuffer: true });
renderer.setSize(n, n, false);
window.three = ([value, aces, exposure]) => {
  renderer.toneMapping = aces ? THREE.ACESFilmicToneMapping : THREE.NoToneMapping;
  renderer.toneMappingExposure = exposure;
  const scene = new THREE.Scene(), camera = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.1, 10);
  const color = new THREE.Color().setRGB(value, value, value); // linear
  const wall = new THREE.Mesh(new THREE.PlaneGeometry(9, 9), new THREE.MeshBasicMaterial({ color }));
  wall.position.z = -5;
  scene.add(wall);
  renderer.render(scene, camera);
  const context = renderer.getContext(), pixel = new Uint8Array(4);
  context.readPixels(n / 2, n / 2, 1, 1, context.RGBA, context.UNSIGNED_BYTE, pixel);
  return pixel[0];
};
const canvas = document.createElement("canvas");
canvas.width = canvas.height = n;
const engine = new BABYLON.Engine(canvas, false, { preserveDrawingBuffer: true });
window.babylon = async ([value, aces]) => {
  const scene = new BABYLON.Scene(engine);
  new BABYLON.FreeCamera("camera", new BABYLON.Vector3(0, 0, -5), scene).setTarget(BABYLON.Vector3.Zero());
  const material = new BABYLON.PBRMaterial("material", scene);
  material.unlit = true;
  material.albedoColor = new BABYLON.Color3(value, value, value); // linear
  BABYLON.MeshBuilder.CreatePlane("wall", { size: 20 }, scene).material = material;
  scene.imageProcessingConfiguration.toneMappingEnabled = aces;
  scene.imageProcessingConfiguration.toneMappingType = BABYLON.ImageProcessingConfiguration.TONEMAPPING_ACES;
  await scene.whenReadyAsync();
  scene.render();
  const pixel = await engine.readPixels(n / 2, n / 2, 1, 1);
  scene.dispose();
  return pixel[0];
};
</script>
END_OF_PAGE
cat > look.py <<'END_OF_PYTHON'
import pathlib
import shutil

import PyOpenColorIO
from playwright.sync_api import sync_playwright

switches = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
configuration = PyOpenColorIO.Config.CreateFromBuiltinConfig("studio-config-v2.1.0_aces-v1.3_ocio-v2.3")
view = PyOpenColorIO.DisplayViewTransform("Linear Rec.709 (sRGB)", "sRGB - Display", "ACES 1.0 - SDR Video")
academy = configuration.getProcessor(view).getDefaultCPUProcessor()


def answer(route):
    file = pathlib.Path(route.request.url.removeprefix("https://page.invalid/"))
    if not file.is_file():
        return route.fulfill(status=404)
    kind = "text/html" if file.suffix == ".html" else "text/javascript"
    return route.fulfill(body=file.read_bytes(), content_type=kind)


def srgb(value):
    return 12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055


with sync_playwright() as playwright:
    program = shutil.which("chromium") or shutil.which("google-chrome")
    browser = playwright.chromium.launch(executable_path=program, args=switches, chromium_sandbox=False)
    page = browser.new_page()
    page.route("**/*", answer)
    page.goto("https://page.invalid/page.html")
    page.wait_for_function("typeof window.babylon === 'function'")
    for value in 0.05, 0.18, 1.0:
        plain = page.evaluate("three", [value, False, 1.0]), page.evaluate("babylon", [value, False])
        three, babylon = page.evaluate("three", [value, True, 1.0]), page.evaluate("babylon", [value, True])
        turned_down = page.evaluate("three", [value, True, 0.6])
        right = 255 * academy.applyRGB([value] * 3)[0]
        print(f"{value}: no tone mapping, three.js {plain[0]}, Babylon.js {plain[1]}; ACES of three.js {three}, with exposure 0.6 {turned_down},")
        print(f"  of Babylon.js {babylon}, of OpenColorIO {right:.1f}")
        assert abs(plain[0] - 255 * srgb(value)) <= 1 and abs(plain[1] - 255 * value ** (1 / 2.2)) <= 1
        # The fit that both use is not the transform itself, and Babylon.js encodes otherwise: less than 5 levels here.
        assert three > right + 15 and abs(babylon - right) < 5 and abs(turned_down - right) < 5
    browser.close()
END_OF_PYTHON
venv/bin/python look.py
