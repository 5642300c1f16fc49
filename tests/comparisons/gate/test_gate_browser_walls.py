"""A page reaches no network, in any way that a browser has, and no file outside of its folder."""

import json
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from comparisons.gate import browser, without_network
from comparisons.gate.driver import Command, Driver, RendererError

pytestmark = pytest.mark.usefixtures("chromium")

ATTEMPTS = """
const patient = (made) =>
  Promise.race([made, new Promise((go) => setTimeout(go, 1500, "nothing happened"))]);
const opened = (of) => new Promise((go) => { of.onopen = of.onerror = (e) => go(e.type); });
const later = () => new Promise((go) => setTimeout(go, 500));
const element = (name, more) => {
  const made = Object.assign(document.createElement(name), more);
  document.body.append(made);
  return made;
};
const gathered = async (RTC) => {
  const peer = new RTC({ iceServers: [{ urls: `stun:127.0.0.1:${UDP}` },
    { urls: `turn:127.0.0.1:${TCP}?transport=tcp`, username: "a", credential: "b" }] });
  peer.createDataChannel("x");
  const all = new Promise((go) => { peer.onicecandidate = (e) => e.candidate ?? go("gathered"); });
  await peer.setLocalDescription(await peer.createOffer());
  return all;
};
const connected = async () => {
  const peer = new RTCPeerConnection();
  peer.createDataChannel("x");
  await peer.setLocalDescription(await peer.createOffer());
  const sdp = peer.localDescription.sdp.replace("actpass", "passive");
  await peer.setRemoteDescription({ type: "answer", sdp });
  const at = (kind, port, more) => peer.addIceCandidate(
    { candidate: `candidate:1 1 ${kind} 99 127.0.0.1 ${port} typ host${more}`, sdpMid: "0" });
  await at("udp", UDP, "");
  await at("tcp", TCP, " tcptype passive");
  await later();
};
const tcp = `127.0.0.1:${TCP}`, udp = `127.0.0.1:${UDP}`;
const everywhere = {
  fetch: () => fetch(`http://${tcp}/`, { mode: "no-cors" }),
  https: () => fetch(`https://${tcp}/`),
  ipv6: () => fetch(`https://[::ffff:127.0.0.1]:${TCP}/`),
  websocket: () => opened(new WebSocket(`ws://${tcp}/`)),
  secure: () => opened(new WebSocket(`wss://${tcp}/`)),
  transport: () => new WebTransport(`https://${udp}/`).ready,
  events: () => opened(new EventSource(`http://${tcp}/`)),
};
const body = `const TCP = ${TCP}, UDP = ${UDP}, tcp = "${tcp}", udp = "${udp}";
  const opened = ${opened};
  const all = [${Object.values(everywhere).map(String)}].map(async (one) => one());
  try { importScripts("http://${tcp}/"); } catch {}
  Promise.allSettled(all).then(() => say("ended"));`;
const script = (text) => URL.createObjectURL(new Blob([text]));
const answered = (of) => new Promise((go) => { of.onmessage = (e) => go(e.data); });
const more = {
  worker: () => answered(new Worker(script(`const say = postMessage; ${body}`))),
  shared: () => answered(new SharedWorker(script(`onconnect = ({ ports: [port] }) => {
    const say = (x) => port.postMessage(x); ${body} };`)).port),
  service: () => navigator.serviceWorker.register("sw.js"),
  beacon: () => navigator.sendBeacon(`http://${tcp}/`, "x"),
  frame: async () => { element("iframe", { src: `http://${tcp}/` }); await later(); },
  picture: async () => { new Image().src = `http://${tcp}/`; await later(); },
  ahead: async () => {
    for (const rel of ["dns-prefetch", "preconnect", "prefetch", "preload", "modulepreload", "icon",
      "stylesheet", "manifest"]) element("link", { rel, href: `http://${tcp}/`, as: "image" });
    const list = [{ source: "list", urls: [`https://${tcp}/`] }];
    element("script", { type: "speculationrules",
      textContent: JSON.stringify({ prefetch: list, prerender: list }) });
    await later();
  },
  popup: async () => { window.open(`http://${tcp}/`); await later(); },
  form: async () => {
    element("form", { action: `http://${tcp}/`, target: "_blank", method: "post" }).submit();
    await later();
  },
  ping: () => element("a", { href: "#here", ping: `http://${tcp}/` }).click(),
  peer: () => gathered(RTCPeerConnection),
  peerOfFrame: () => gathered(element("iframe").contentWindow.RTCPeerConnection),
  peerOfDocument: () => new Promise((go) => {
    const frame = element("iframe", { srcdoc: "<p>" });
    frame.onload = () => go(gathered(frame.contentWindow.RTCPeerConnection));
  }),
  peerOfPopup: () => gathered(window.open("about:blank").RTCPeerConnection),
  connected,
};
const all = [...Object.values(everywhere), ...Object.values(MORE ? more : {})];
await Promise.all(all.map(async (one) => {
  try { await patient(one()); } catch {}
}));
"""
"""Tries to reach the ports TCP and UDP of this machine; at the end all ways were tried, with MORE
also those that take longer."""


@pytest.fixture
def ports() -> Iterator[tuple[dict[str, int], list[str]]]:
    """Two ports of this machine, and which of them heard something."""
    heard: list[str] = []
    tcp = socket.create_server(("127.0.0.1", 0))
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind(("127.0.0.1", 0))

    def listen(port: socket.socket, kind: str) -> None:
        while True:
            try:
                port.accept()[0].close() if kind == "tcp" else port.recv(4096)
            except OSError:  # the test has ended
                return
            heard.append(kind)

    for port, kind in ((tcp, "tcp"), (udp, "udp")):
        port.settimeout(60)
        threading.Thread(target=listen, args=(port, kind), daemon=True).start()
    yield {"TCP": tcp.getsockname()[1], "UDP": udp.getsockname()[1]}, heard
    for port in (tcp, udp):
        port.close()


def attempts(**values: int) -> str:
    return "".join(f"const {name} = {value}; " for name, value in values.items()) + ATTEMPTS


@pytest.mark.parametrize(
    ("switches", "script", "expected"),
    [
        ((), "", {"tcp", "udp"}),
        (browser.NO_NETWORK, "", set()),
        (browser.NO_NETWORK, browser.BEFORE, set()),
    ],
    ids=["without walls", "switches", "as the gate has them"],
)
def test_no_attempt_reaches_a_port(
    ports: tuple[dict[str, int], list[str]],
    switches: tuple[str, ...],
    script: str,
    expected: set[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In this test's own network: each wall by itself, and that there is something to hold back."""
    from playwright.sync_api import sync_playwright

    where, heard = ports
    monkeypatch.setattr(browser, "NO_NETWORK", switches)
    monkeypatch.setattr(browser, "BEFORE", script)
    (tmp_path / "page.html").write_text("<body>")
    with sync_playwright() as playwright:
        started = browser.launched(playwright.chromium)
        page = browser.opened(started, tmp_path.resolve(), None)
        page.goto(f"{browser.HOST}/page.html")
        page.evaluate(f"(async () => {{ {attempts(**where, MORE=1)} }})()")
        left = page.evaluate("typeof RTCPeerConnection")
        started.close()
    assert set(heard) == expected
    assert left == ("undefined" if script else "function")


FORGETFUL = """#!{python}
import os, sys
os.execv({chromium!r}, [word for word in sys.argv if word not in {switches!r}])
"""
"""A browser that ignores the switches."""


def printed(*words: str) -> str:
    run = subprocess.run(words, check=False, capture_output=True, text=True)
    return run.stdout + run.stderr


def test_the_gate_lets_nothing_through(
    ports: tuple[dict[str, int], list[str]],
    chromium: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The whole way, with a browser that ignores the switches where there is the second wall.
    Files outside of the page's folder are beside it, behind links."""
    where, heard = ports
    namespace = [sys.executable, "-c", "import os; print(os.readlink('/proc/self/ns/net'))"]
    wall = [sys.executable, "-I", "-S", without_network.__file__]
    if sys.platform == "linux" and printed(*namespace) != printed(*wall, *namespace):
        program = tmp_path / "forgetful"
        values = {"python": sys.executable, "chromium": chromium, "switches": browser.NO_NETWORK}
        program.write_text(FORGETFUL.format(**values))
        program.chmod(0o700)
        monkeypatch.setenv("CHROMIUM", str(program))
    inside = tmp_path / "inside"
    inside.mkdir()
    (tmp_path / "secret").write_text("secret")
    (inside / "own").write_text("own")
    (inside / "link").symlink_to("../secret")
    (inside / "folder").symlink_to("..")
    os.mkfifo(inside / "pipe")
    names = ["own", "link", "folder/secret", "pipe", "..%2fsecret", "%2e%2e/secret", "../secret"]
    names += ["..%252fsecret", "x%00", "/", f"/{tmp_path}/secret", f"file://{tmp_path}/secret"]
    body = f"""<script>window.render = async () => {{
      {attempts(**where, MORE=0)}
      const found = {{}};
      for (const name of {json.dumps(names)}) {{
        try {{
          const answer = await fetch(name);
          found[name] = answer.ok ? await answer.text() : answer.status;
        }} catch {{ found[name] = "an error"; }}
      }}
      console.log(`found ${{JSON.stringify(found)}}`);
    }};</script>"""
    (inside / "page.html").write_text(body)
    monkeypatch.chdir(inside)
    more = {"scene": None, "spp": None, "size": (6, 3), "suffix": ".npy", "seconds": 60.0}
    with pytest.raises(RendererError, match="pixels of Undefined"):
        Driver(Command.of_page("page.html", **more), tmp_path / "kept").pictures([1])
    said = (tmp_path / "kept" / "renderer.log").read_text()
    found = json.loads(said.partition("log: found ")[2].partition("\n")[0])
    assert {name for name, content in found.items() if "secret" in str(content)} == set()
    assert found["own"] == "own"
    assert [found[name] for name in ("link", "folder/secret", "pipe")] == [403, 403, 403]
    assert heard == []
    assert f"{inside}/link is not read: it lies outside of {inside}" in said
