"""Fixtures that several test modules share."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders import HELPERS
from command_line import invoke
from gate_checks import SCENE, pictures
from page_in_browser import BROKEN_WORDS, CONTRASTS, FIRST_PICTURE
from PIL import Image
from suite_runs import RUNNER
from typer.testing import Result

from comparisons.gate import reference_cache
from comparisons.gate.browser import PageError, chromium_program
from comparisons.mitsuba.backend import Backend
from comparisons.report import write_report
from comparisons.suites import run
from comparisons.translator import load
from reference_rt.core.arrays import FloatArray
from reference_rt.integrators.scene_tables import SceneTables
from reference_rt.rendering.scene import Scene
from reference_rt.scene.build import build_tables

# ---- scenes and their counterparts --------------------------------------------------------------


@pytest.fixture(scope="module")
def tables(scene: Scene) -> SceneTables:
    """Those of the module's own fixture `scene`."""
    return build_tables(scene)


@pytest.fixture(scope="module")
def counterpart(scene: Scene) -> Any:
    return load(scene)


# ---- images that textures and skies are made of ------------------------------------------------


@pytest.fixture(scope="module")
def image_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("images")
    rng = np.random.default_rng(3)

    def write(name: str, values: Any, size: tuple[int, int]) -> None:
        image = Image.fromarray((255.0 * values).astype(np.uint8)).resize(size, Image.BICUBIC)
        image.save(path / name)

    write("colours.png", rng.uniform(size=(4, 6, 3)), (24, 16))
    write("heights.png", rng.uniform(size=(6, 6)), (32, 32))
    write("wide.png", rng.uniform(size=(6, 6)), (32, 16))
    write("sky.png", rng.uniform(size=(8, 16, 3)) ** 3, (32, 16))
    tilt = 0.1 * np.sin(np.linspace(0.0, 9.0, 32))
    write(
        "normals.png",
        np.dstack([*np.meshgrid(0.5 + tilt, 0.5 + tilt), np.full((32, 32), 0.95)]),
        (32, 32),
    )
    return path


# ---- the page in a browser ----------------------------------------------------------------------

WIDE = {"width": 1200, "height": 900}


@pytest.fixture(scope="session")
def chromium() -> str:
    """The browser's program; without one, and without Playwright, the test is skipped."""
    pytest.importorskip(
        "playwright.sync_api",
        reason="playwright is not installed: pip install 'reference-rt[test]'",
    )
    try:
        return chromium_program()
    except PageError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def browser(chromium):
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        # A sandbox needs rights that a container does not give; the page is our own.
        yield driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])


@pytest.fixture(scope="module")
def window(browser):
    """One page for all tests, which is quicker than one for each."""
    return browser.new_context(viewport=WIDE, offline=True).new_page()


@pytest.fixture
def show(browser, window, tmp_path):
    """Write a page about cases and open it; it must neither complain nor ask for anything."""
    complaints, requests, contexts = [], [], []
    listeners = {
        "console": lambda message: complaints.append(message.text),
        "pageerror": lambda error: complaints.append(str(error)),
        "dialog": lambda dialog: complaints.append(dialog.message),
        "request": lambda request: requests.append(request.url),
    }

    def opened(*cases, report=None, **options):
        path = tmp_path / "report.html"
        write_report(path, cases, {"date": "2025-11-20"}, **(report or {}))
        page = window
        if options:
            contexts.append(browser.new_context(**{"viewport": WIDE} | options))
            page = contexts[0].new_page()
        for event, listener in listeners.items():
            page.on(event, listener)
        page.emulate_media(media="screen")  # another test may have left it on paper
        page.goto(path.as_uri())
        return page

    yield opened
    for context in contexts:
        context.close()
    if not contexts:
        for event, listener in listeners.items():
            window.remove_listener(event, listener)
    assert complaints == []
    asked = [url for url in requests if not url.startswith("data:")]
    assert [url.startswith("file:") for url in asked] == [True]


@pytest.fixture
def check_page(browser):
    """Check a page: it asks for nothing, complains of nothing, can be read in both colour schemes,
    begins with a picture or a chart, is as wide as the window, that of a telephone too, and breaks
    no word.

    pictures: whether it has any.
    """

    def check(path, pictures=True):
        for width, scheme in ((1400, "light"), (400, "dark")):
            size = {"width": width, "height": 900}
            context = browser.new_context(viewport=size, color_scheme=scheme, offline=True)
            page, complaints, requests = context.new_page(), [], []
            page.on("console", lambda message, to=complaints: to.append(message.text))
            page.on("request", lambda request, to=requests: to.append(request.url))
            page.goto(path.as_uri())
            if pictures and width == 1400:
                assert page.evaluate(FIRST_PICTURE) < 400
            page.evaluate("document.querySelectorAll('details').forEach((d) => (d.open = true))")
            assert complaints == []
            assert [url for url in requests if not url.startswith("data:")] == [path.as_uri()]
            assert page.evaluate(CONTRASTS) == []
            assert page.evaluate(BROKEN_WORDS) == []
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            context.close()

    return check


# ---- suites -------------------------------------------------------------------------------------


@pytest.fixture
def fake_runners(monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers find `suite_runners`, and no backend is looked for."""
    monkeypatch.setenv("PYTHONPATH", str(HELPERS))
    monkeypatch.setattr(run, "backend", lambda: Backend("llvm_ad_rgb", "0", "", None))
    monkeypatch.setattr(run, "provenance", lambda **more: {"mitsuba": "none", **more})


class Program:
    """`reference-rt suite`, `compare` and `report`, whose workers run what `suite_runners` does;
    found: what the last run found."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.found: run.Run | None = None
        whole = run.run_cases

        def with_fakes(plan: Any, options: run.Options, *more: Any) -> run.Run:
            self.found = whole(plan, replace(options, runner=RUNNER), *more)
            return self.found

        monkeypatch.setattr(run, "run_cases", with_fakes)
        for name in ("GITHUB_ACTIONS", "GITHUB_STEP_SUMMARY"):
            monkeypatch.delenv(name, raising=False)

    def __call__(self, *arguments: Any) -> Result:
        return invoke(*arguments)


@pytest.fixture
def program(fake_runners: None, monkeypatch: pytest.MonkeyPatch) -> Program:
    return Program(monkeypatch)


# ---- the gate -----------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def gate_references(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder of references for all tests."""
    return tmp_path_factory.mktemp("references")


@pytest.fixture
def gate_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, gate_references: Path) -> Path:
    """The working folder is the test's own, and it is not CI's."""
    for name in ("CI", "GITHUB_ACTIONS", "GITHUB_STEP_SUMMARY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(reference_cache, "cache_folder", lambda: gate_references)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ball.yaml").write_text(SCENE)
    return tmp_path


@pytest.fixture(scope="session")
def right() -> FloatArray:
    """Replicates that are right."""
    return pictures()
