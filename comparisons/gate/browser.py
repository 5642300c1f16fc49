"""A web page as a renderer: what `gate --browser` runs as its command.

`python -m comparisons.gate.browser PAGE DATA OUTPUT SEEDS SPP WIDTH HEIGHT` opens PAGE (a file, and
its `?query`) in Chromium and awaits `window.render({scene, seed, spp, width, height})`, which
`docs/realtime.md` describes, for each of the SEEDS.  It writes OUTPUT, in which %d stands for the
seed.  DATA is the folder of scene.json, or - without a scene.  What goes wrong is printed, and the
exit code is 1.

No port is opened: the browser's requests are answered here, from the page's folder and DATA, and
all others fail (`NO_NETWORK`).  WebGL and WebGPU compute in software, so that all machines have the
same pixels.
"""

import base64
import mimetypes
import os
import shutil
import sys
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit

import numpy as np

from comparisons.gate.page_files import read_below
from reference_rt.util.extras import needs

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserType, Page, Route

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
"""Programs that are looked for where CHROMIUM names none."""

SOFTWARE = (
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"),
    *("--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader"),
)

NO_NETWORK = (
    # Whatever is not answered here goes to a proxy, also what is meant for this machine.  The
    # proxy's name has no address, nor has any other.
    *("--proxy-server=proxy.invalid:1", "--proxy-bypass-list=<-loopback>"),
    "--host-resolver-rules=MAP * ~NOTFOUND",
    # WebRTC alone would send its packets past the proxy.  The second is an older name.
    "--webrtc-ip-handling-policy=disable_non_proxied_udp",
    "--force-webrtc-ip-handling-policy=disable_non_proxied_udp",
)
"""Switches by which nothing in the browser reaches a network: requests that Playwright does not see
(WebSocket, WebTransport, what is loaded ahead, shared workers), WebRTC, and the browser's own.
`without_network.py` is a second wall, where the machine has it."""

HOST = "https://page.invalid"
"""A name that no server has; https, because WebGPU and others need a secure context."""

ISOLATED = {
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Embedder-Policy": "require-corp",
}
"""Headers by which a page may share memory between threads."""

SCENE = "/reference-rt-scene/"
"""Where the page finds the scene."""

CHUNK = 3 << 20
"""Bytes that the page hands over at once; of three, so that base64 needs no padding between."""

BEFORE = """(() => {
  let fail;
  const failed = new Promise((_, no) => (fail = (why) => no(new Error(why))));
  failed.catch(() => {});
  const contexts = new Set();
  for (const kind of [HTMLCanvasElement, OffscreenCanvas]) {
    const get = kind.prototype.getContext;
    kind.prototype.getContext = function (...of) {
      const found = get.apply(this, of);
      if (found?.drawingBufferWidth !== undefined && !contexts.has(found)) {
        contexts.add(found);
        this.addEventListener("webglcontextlost", () => fail("the WebGL context was lost"));
      }
      return found;
    };
  }
  window.addEventListener("error", (e) => {
    if (e instanceof ErrorEvent) fail(`an uncaught error: ${e.message}`);
    else if (e.target instanceof HTMLScriptElement)
      fail(`a script was not loaded: ${e.target.src || "one in the page, or what it imports"}`);
  }, true);
  window.addEventListener("unhandledrejection", (e) => fail(`an uncaught error: ${e.reason}`));
  for (const name of ["RTCPeerConnection", "webkitRTCPeerConnection"]) delete window[name];
  window.__gate = { failed, contexts };
})();"""
"""Runs before the page's own scripts: errors that they do not await end the run at once.  Switches
of browsers are renamed and then ignored without a word, so WebRTC is also taken away."""

READY = """() => Promise.race([__gate.failed, (async () => {
  while (typeof window.render !== "function") await new Promise((go) => setTimeout(go, 20));
})()])"""

RENDER = """async ([task, kinds]) => {
  const found = (await Promise.race([__gate.failed, window.render(task)])) ?? {};
  for (const gl of __gate.contexts)
    if (gl.isContextLost()) throw new Error("the WebGL context was lost");
  const { width, height, pixels, bottomUp } = found;
  const kind = Object.prototype.toString.call(pixels).slice(8, -1);
  if (!kinds.includes(kind))
    throw new Error(`window.render returned pixels of ${kind}; expected ${kinds.join(" or ")}`);
  __gate.bytes = new Uint8Array(pixels.buffer, pixels.byteOffset, pixels.byteLength);
  return { width, height, bottomUp: !!bottomUp, bytes: __gate.bytes.length };
}"""

BYTES = """([begin, end]) => {
  let text = "";
  for (let k = begin; k < end; k += 32768)
    text += String.fromCharCode(...__gate.bytes.subarray(k, Math.min(k + 32768, end)));
  return btoa(text);
}"""


class PageError(Exception):
    """What is wrong with the page, its picture or the browser."""


def chromium_program() -> str:
    """The browser: CHROMIUM, or the first of BROWSERS.  Raises PageError."""
    named = os.environ.get("CHROMIUM")
    found = named or next(filter(None, map(shutil.which, BROWSERS)), None)
    if not found:
        raise PageError(f"no browser: set CHROMIUM, or install one of {', '.join(BROWSERS)}")
    return found


def launched(chromium: "BrowserType") -> "Browser":
    """Chromium, in its sandbox where the machine permits one.  Raises PageError."""
    from playwright.sync_api import Error

    found = chromium_program()
    switches = [*SOFTWARE, *NO_NETWORK]
    # Root, and containers without user namespaces, have no sandbox.
    for sandbox in (True, False) if os.geteuid() else (False,):
        try:
            return chromium.launch(
                executable_path=found,
                args=switches,
                chromium_sandbox=sandbox,
                timeout=0,
            )
        except Error as error:
            if not (sandbox and "sandbox" in str(error).lower()):
                raise PageError(f"{found}: cannot be started: {_first_lines(error)}") from None
    raise AssertionError("unreachable")


def opened(browser: "Browser", root: Path, data: Path | None) -> "Page":
    """A new page, whose requests are answered from these folders, whose paths are resolved."""
    context = browser.new_context(service_workers="block", accept_downloads=False)
    context.set_default_timeout(0)  # the gate has a limit of its own
    context.route("**/*", partial(_answer, root, data))
    context.add_init_script(BEFORE)
    return context.new_page()


def _answer(root: Path, data: Path | None, route: "Route") -> None:
    """Answer a request from the files of the page or of the scene."""
    address = route.request.url
    path = unquote(urlsplit(address).path)
    folder = root
    if data is not None and path.startswith(SCENE):
        folder, path = data, path.removeprefix(SCENE)
    if not address.startswith(f"{HOST}/"):
        print(f"asked for {address}: the gate gives no network")
        route.abort()
        return
    file = folder / path.lstrip("/")
    try:
        content = read_below(folder, path)
    except (FileNotFoundError, NotADirectoryError):
        print(f"asked for {address}: there is no file {file}")
        route.fulfill(status=404)
    except OSError as error:
        print(f"asked for {address}: {file} is not read: {error.strerror}")
        route.fulfill(status=403)
    else:
        kind = mimetypes.guess_type(path)[0] or "application/octet-stream"
        route.fulfill(body=content, content_type=kind, headers=ISOLATED)


def rendered(page: "Page", task: dict[str, Any], codes: bool) -> np.ndarray:
    """The picture of one seed: (height, width, 3 or 4), row 0 on top;  codes: 8-bit sRGB.  Raises
    PageError."""
    kinds = ["Uint8Array", "Uint8ClampedArray"] if codes else ["Float32Array"]
    found = page.evaluate(RENDER, [task, kinds])
    width, height, size = found["width"], found["height"], found["bytes"]
    number = np.dtype("u1" if codes else "<f4")
    if not all(isinstance(x, int) and x > 0 for x in (width, height)):
        raise PageError(f"window.render returned width {width} and height {height}; expected both")
    channels, rest = divmod(size, number.itemsize * width * height)
    if rest or channels not in (3, 4):
        raise PageError(
            f"window.render returned {size // number.itemsize} numbers for {width} x {height} "
            "pixels; expected 3 or 4 each"
        )
    parts = [
        page.evaluate(BYTES, [begin, min(begin + CHUNK, size)]) for begin in range(0, size, CHUNK)
    ]
    values = np.frombuffer(base64.b64decode("".join(parts)), number)
    picture = values.reshape(height, width, channels)
    return picture[::-1] if found["bottomUp"] else picture


def write(picture: np.ndarray, file: str) -> None:
    if picture.dtype == np.uint8:
        from PIL import Image

        Image.fromarray(np.ascontiguousarray(picture)).save(file)
    else:
        np.save(file, picture)


def _first_lines(error: Exception) -> str:
    """The message, and where it was thrown."""
    text = str(error).removeprefix("Page.evaluate: ").removeprefix("BrowserType.launch: ")
    return "\n".join(text.split("\n")[:2])


def main(page_file: str, folder: str, output: str, *numbers: str) -> None:
    from playwright.sync_api import Error, sync_playwright

    path, _, query = page_file.partition("?")
    file, here = Path(path).resolve(), Path.cwd()
    if not file.is_file():
        raise PageError(f"{path}: there is no such page")
    root = here if file.is_relative_to(here) else file.parent
    data = None if folder == "-" else Path(folder).resolve()
    seeds, *sizes = numbers
    spp, width, height = (None if text == "-" else int(text) for text in sizes)
    scene = None if data is None else f"{HOST}{SCENE}scene.json"
    # The gate's temporary folder: where it kills this process, the browser's files go with it.
    os.environ["TMPDIR"] = str(Path(output).absolute().parents[1])
    with sync_playwright() as playwright:
        browser = launched(playwright.chromium)
        page = opened(browser, root, data)
        page.on("console", lambda message: print(f"{message.type}: {message.text}"))
        page.on("dialog", lambda dialog: dialog.dismiss())
        try:
            page.goto(f"{HOST}/{file.relative_to(root).as_posix()}{'?' if query else ''}{query}")
            print("waits for window.render to be defined", flush=True)
            page.evaluate(READY)
            print("waits for window.render to return", flush=True)
            for seed in map(int, seeds.split(",")):
                task = {"scene": scene, "seed": seed, "spp": spp, "width": width, "height": height}
                picture = rendered(page, task, output.endswith(".png"))
                write(picture, output.replace("%d", str(seed)))
        except Error as error:
            raise PageError(_first_lines(error)) from None
        finally:
            with suppress(Error):  # it may have crashed
                browser.close()


if __name__ == "__main__":
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    try:
        main(*sys.argv[1:])
    except PageError as error:
        sys.exit(str(error))
    except ModuleNotFoundError as error:
        sys.exit(needs("a page", "browser", error.name))
