#!/usr/bin/env bash
# three.js 0.187.0: a `Reflector` without a colour shows 0.42 of what it mirrors. It lays its default colour, 0x7f7f7f, over
# that with Photoshop's "overlay", to which a grey of one half is nothing; but colours are decoded to linear values, and this
# one is 0.212. A mirrored 0.4 is 0.170, and a mirrored 0.8 is 0.685. Seen on 2026-11-29. It needs Chromium
# (apt install chromium); the page is served to it alone, by Playwright.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check playwright==1.65.2 numpy==2.4.6
npm install --silent --no-audit --no-fund three@0.187.0
cat > page.html <<'END'
<script type=importmap>{"imports": {
  "three": "/node_modules/three/build/three.module.js", "three/addons/": "/node_modules/three/examples/jsm/"}}</script>
<script type=module>
import * as THREE from "three";
import { Reflector } from "three/addons/objects/Reflector.js";
const renderer = new THREE.WebGLRenderer(), n = 16;
renderer.setSize(n, n, false);
window.show = (value) => {
  const scene = new THREE.Scene(), camera = new THREE.PerspectiveCamera(20, 1, 0.1, 100);
  const color = new THREE.Color().setRGB(value, value, value);
  const wall = new THREE.Mesh(new THREE.PlaneGeometry(50, 50), new THREE.MeshBasicMaterial({ color, side: THREE.DoubleSide }));
  wall.position.z = 5; // behind the eye, which looks along -z
  const mirror = new Reflector(new THREE.PlaneGeometry(10, 10));
  mirror.position.z = -5;
  scene.add(wall, mirror);
  const target = new THREE.WebGLRenderTarget(n, n, { type: THREE.FloatType });
  renderer.setRenderTarget(target);
  renderer.render(scene, camera);
  const pixels = new Float32Array(4 * n * n);
  renderer.readRenderTargetPixels(target, 0, 0, n, n, pixels);
  return pixels[4 * (n * n / 2 + n / 2)];
};
</script>
END
cat > look.py <<'END'
import pathlib
import shutil

from playwright.sync_api import sync_playwright

switches = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]


def answer(route):
    file = pathlib.Path(route.request.url.removeprefix("https://page.invalid/"))
    if not file.is_file():
        return route.fulfill(status=404)
    kind = "text/html" if file.suffix == ".html" else "text/javascript"
    return route.fulfill(body=file.read_bytes(), content_type=kind)


with sync_playwright() as playwright:
    program = shutil.which("chromium") or shutil.which("google-chrome")
    browser = playwright.chromium.launch(executable_path=program, args=switches, chromium_sandbox=False)
    page = browser.new_page()
    page.route("**/*", answer)
    page.goto("https://page.invalid/page.html")
    page.wait_for_function("typeof window.show === 'function'")
    shown = {value: page.evaluate(f"show({value})") for value in (0.1, 0.4, 0.8)}
    browser.close()
for value, found in shown.items():
    print(f"mirrored {value}: shown {found:.4f}")
grey = ((127 / 255 + 0.055) / 1.055) ** 2.4
for value, found in shown.items():
    overlay = 2 * value * grey if value < 0.5 else 1 - 2 * (1 - value) * (1 - grey)
    assert abs(found - overlay) < 1e-3, (value, found, overlay)
END
venv/bin/python look.py
echo "as described"
