"""pytest plugin: the fixtures `image_gate`, `derivative_gate`, `material_gate` and `pair_gate`,
which check a picture, its derivative, a material, and two renderers, in one line of a test.

    def test_cornell_box(image_gate):
        image_gate(my_renderer("scenes/cornell_box.yaml"), scene="scenes/cornell_box.yaml")

    def test_its_derivative(derivative_gate):
        derivative_gate(my_gradients(), primal=my_picture, at=0.5)

    def test_my_metal(material_gate):
        material_gate(my_evaluate, my_sample, my_pdf)

    def test_back_ends(pair_gate):
        pair_gate(my_renderer("cpu"), my_renderer("gpu"), scene="scenes/cornell_box.yaml")

It imports nothing but pytest until it is used.
"""

import hashlib
import importlib
import re
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from comparisons.gate import session, uses
from comparisons.gate.session import pytest_configure as pytest_configure

if TYPE_CHECKING:
    from comparisons.gate.material import Check
    from comparisons.gate.pictures_in import Picture
    from comparisons.results.case import Case


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--image-gate-out` and `--image-gate-baselines`, and what `session` adds."""
    group = parser.getgroup("image_gate", "compare pictures with scenes and baselines")
    group.addoption(
        "--image-gate-out",
        metavar="DIR",
        help="folder for results.json and, for failures, the pictures and a page, in a folder per "
        "test (default: image-gate, in the root folder)",
    )
    group.addoption(
        "--image-gate-baselines",
        metavar="DIR",
        help="the folder of baselines (default: baselines, in the root folder)",
    )
    session.pytest_addoption(parser)


@pytest.fixture
def image_gate(request: pytest.FixtureRequest) -> "ImageGate":
    """Compares pictures: see `ImageGate.__call__`."""
    return ImageGate(request.node, request.config)


@pytest.fixture
def derivative_gate(request: pytest.FixtureRequest) -> "DerivativeGate":
    """Compares derivatives of pictures: see `DerivativeGate.__call__`."""
    return DerivativeGate(request.node, request.config)


@pytest.fixture
def material_gate(request: pytest.FixtureRequest) -> "MaterialGate":
    """Checks materials: see `MaterialGate.__call__`."""
    return MaterialGate(request.node, request.config)


@pytest.fixture
def pair_gate(request: pytest.FixtureRequest) -> "PairGate":
    """Compares the pictures of two renderers: see `PairGate.__call__`."""
    return PairGate(request.node, request.config)


def _limit(text: str) -> float:
    """The smallest bias that must be detectable, by default.  Raises pytest.UsageError."""
    from comparisons.results import LIMIT

    try:
        return float(text or LIMIT)
    except ValueError:
        told = f"image_gate_limit: expected a number such as 0.005, got '{text}'"
        raise pytest.UsageError(told) from None


_CALLS = pytest.StashKey[int]()
"""Calls of gates in a test so far."""


class Gate:
    """The gate for one test; each call has a folder of its own."""

    fixture = "gate"

    def __init__(self, node: pytest.Item, config: pytest.Config) -> None:
        self._node, self._root, self._calls = node, config.rootpath, 0
        self._noted = config.pluginmanager.get_plugin(session.NAME) is not None
        report, _ = session.folders(config)
        self._has_pages = report is not None
        usual = self._root / "image-gate" if report is None else report / "tests"
        self._out = self._root / (session.option(config, "image_gate_out") or usual)
        kept = session.option(config, "image_gate_baselines")
        self._baselines = self._root / (kept or "baselines")
        self._limit = _limit(str(config.getini("image_gate_limit")))

    def _judge(
        self,
        candidate: Any,
        judged: "Callable[[list[Picture], str], Case]",
        baseline: str = "",
    ) -> "Case":
        """Fail the test unless the case passes that `judged` makes of the pictures, by its name."""
        __tracebackhide__ = True
        self._begin("comparisons.gate.request")
        from reference_rt.util.errors import ReferenceRtError

        failed, begun = "", time.perf_counter()
        given: list[tuple[Picture, Path | None]] = []
        try:
            folder = self._folder()
            given = _pictures(candidate, folder)
            name = self._node.nodeid + (f" [{self._calls}]" if self._calls > 1 else "")
            case = judged([picture for picture, _ in given], name)
            passed = self._write(case, folder, baseline)
        except ReferenceRtError as error:
            failed = f"{self.fixture}: {error}"
        if failed:
            kept, unkept = _kept(given)
            self._note_error(failed)
            pytest.fail("\n".join([failed, *kept, *unkept]))
        if self._noted:
            seconds = time.perf_counter() - begun
            self._note(folder=str(folder), seconds=seconds, **uses.of_case(case, passed))
        self._node.user_properties.append((self.fixture, f"{case.verdict}: {case.reason}"))
        if not passed:
            _, unkept = _kept(given)
            told = _message(case, _relative(folder, self._root), self.fixture)
            pytest.fail("\n".join([told, *unkept]))
        return case

    def _note(self, **what: Any) -> None:
        """Note this call for the page of the session, if there is one."""
        if self._noted:
            uses.note(self._node, self.fixture, self._calls, **what)

    def _note_error(self, message: str) -> None:
        """Note a call that could not be judged."""
        self._note(verdict="error", passed=False, headline=message, reason=message)

    def _begin(self, module: str) -> None:
        """A call of the gate, which needs a module.  Fails the test if its extra is missing."""
        __tracebackhide__ = True
        # Of all gates of the test, whose folders are beside each other.
        self._calls = self._node.stash[_CALLS] = self._node.stash.get(_CALLS, 0) + 1
        missing = ""
        try:
            importlib.import_module(module)
        except ModuleNotFoundError as error:
            from reference_rt.util.extras import needs

            missing = needs(self.fixture, "compare", error.name)
        # Failing outside of `except`: pytest would show the handled error, with all its frames.
        if missing:
            self._note_error(missing)
            pytest.fail(missing)

    def _folder(self) -> Path:
        """The folder of this call, the same in each run; outputs of an earlier run are removed.
        Raises ImageError where it cannot be written."""
        from reference_rt.util.files import check_writable, discard

        nodeid = self._node.nodeid
        plain = re.sub(r"[^A-Za-z0-9._-]+", "-", nodeid.rpartition("/")[2]).strip("-.")
        # Names that differ only in replaced characters must not share a folder.
        unique = hashlib.sha256(nodeid.encode()).hexdigest()[:8]
        folder = self._out / f"{plain[:80]}-{unique}-{self._calls}"
        # Before the check, which removes folders that it made: another process of pytest-xdist may
        # be about to write there.
        with suppress(OSError):
            self._out.mkdir(parents=True, exist_ok=True)
        files = [folder / n for n in ("results.json", "report.html", "case.json", "pictures.exr")]
        check_writable(*files)
        for file in files:
            discard(file)
        for old in (*folder.glob("candidate-*.exr"), *folder.glob("*.png")):
            discard(old)
        return folder

    def _write(self, case: "Case", folder: Path, baseline: str) -> bool:
        """Write results.json; for a failure, or a page of the session, also the page, and for a
        failure the pictures.  Whether it passes."""
        from comparisons.gate import outputs
        from comparisons.results.stored_case import write_case

        passed = outputs.code_of(case) == 0
        facts = {"baseline": baseline} if baseline else {}
        outputs.write(case, folder, facts, page=self._has_pages or not passed)
        if not passed:
            write_case(folder, case)
        return passed


class ImageGate(Gate):
    """The gate for pictures."""

    fixture = "image_gate"

    def __call__(
        self,
        candidate: Any,
        *,
        scene: str | Path | None = None,
        baseline: str = "",
        reference: Any = None,
        variance: str | Path | None = None,
        limit: float | None = None,
        noise_free: bool = False,
        tolerance: float = 0.001,
        tone_curve: str = "",
        rim: int = 0,
        defaults: Mapping[str, str] | None = None,
    ) -> "Case":
        """Fail the test unless `candidate` agrees with the scene, the baseline or the reference.

        candidate: linear radiance, an array (height, width, 3), with opacity (height, width, 4), or
        (replicates, height, width, 3 or 4), or a file (EXR, PNG, PFM, HDR, NPY), or a list of
        these, which are replicates;  scene: a scene file, relative to the root folder, which
        reference_rt renders as the reference;  baseline: the name of a baseline that `reference-rt
        accept` wrote;  reference: pictures, like `candidate`;  variance: a file with the variance
        of a single reference;  limit: the smallest relative bias of the image mean that must be
        detectable;  noise_free: the candidates were rendered without random numbers;  tolerance:
        relative error of a value of such a picture of a scene;  tone_curve: what such a picture
        went through, as of `gate --tone-curve`;  rim: how many of the outermost pixels are left out
        on each side;  defaults: values for the <default> elements of a Mitsuba scene.

        Pictures that are too noisy to tell fail too.  Returns the
        `comparisons.results.case.Case`.
        """
        __tracebackhide__ = True

        def judged(pictures: "list[Picture]", name: str) -> "Case":
            from comparisons.gate.pictures_in import pictures_of
            from comparisons.gate.request import Request, gated
            from reference_rt.rendering.scene import Scene

            request = Request(
                scene=None if scene is None else Scene.load(self._root / scene, defaults),
                references=() if reference is None else pictures_of(reference),
                variance=None if variance is None else Path(variance),
                baseline=baseline,
                baselines=self._baselines,
                limit=self._limit if limit is None else limit,
                noise_free=noise_free,
                tolerance=tolerance,
                tone_curve=tone_curve,
                rim=rim,
                name=name,
            )
            return gated(request, pictures)

        return self._judge(candidate, judged, baseline)


class DerivativeGate(Gate):
    """The gate for derivatives."""

    fixture = "derivative_gate"

    def __call__(
        self,
        candidate: Any,
        *,
        scene: str | Path | None = None,
        parameter: str = "",
        closed: Any = None,
        primal: "Callable[[float, int], Any] | None" = None,
        at: float | None = None,
        step: float | None = None,
        limit: float | None = None,
    ) -> "Case":
        """Fail the test unless `candidate` is the derivative of a picture by a parameter.

        candidate: derivatives (replicates, height, width, 3), two or more, or files of these, in
        W/sr/m2 per unit of the parameter.  They are compared with one of these: differences of our
        pictures of a scene, a file relative to the root folder, by a parameter of it, which is a
        path such as materials.red.reflectance;  closed: the exact derivative (height, width, 3);
        primal: the renderer's own picture (height, width, 3), a function of the parameter's value
        and of a seed, which is differenced about `at`.  step: of the differences;  limit: the
        smallest bias of the image mean, over the derivative's size, that must be detectable.

        Derivatives that are too noisy to tell fail too.  Returns the
        `comparisons.results.case.Case`.
        """
        __tracebackhide__ = True

        def judged(pictures: "list[Picture]", name: str) -> "Case":
            from comparisons.gate.derivative import Asked, case_of
            from reference_rt.rendering.scene import Scene

            asked = Asked(
                scene=None if scene is None else Scene.load(self._root / scene),
                parameter=parameter,
                closed=closed,
                primal=primal,
                at=at,
                step=step,
                limit=self._limit if limit is None else limit,
                name=name,
            )
            return case_of([picture.radiance for picture in pictures], asked)

        return self._judge(candidate, judged)


class MaterialGate(Gate):
    """The gate for functions of a material."""

    fixture = "material_gate"

    def __call__(
        self,
        evaluate: Callable[[Any, Any], Any],
        sample: Callable[[Any, Any], Any],
        pdf: Callable[[Any, Any], Any],
        *,
        views: Any = None,
        eta: float | None = None,
        reciprocal: bool = True,
        precision: Any = None,
        seed: int = 0,
    ) -> "list[Check]":
        """Fail the test unless a material's functions of arrays fit together, do not create light,
        and are reciprocal; arguments: see `comparisons.gate.material.check_material`.  Pictures of
        what is wrong are kept.  Returns the checks."""
        __tracebackhide__ = True
        self._begin("comparisons.gate.material")
        from comparisons.gate.material import check_material
        from reference_rt.util.errors import ReferenceRtError

        lines: list[str] = []
        found: list[Check] = []
        pictures: list[Path] = []
        begun = time.perf_counter()
        try:
            folder = self._folder()
            asked = {"views": views, "eta": eta, "reciprocal": reciprocal, "seed": seed}
            found = check_material(evaluate, sample, pdf, precision=precision, **asked)
            for check in found:
                if not check:
                    lines.append(f"{self.fixture}: {check.name}: {check.reason}")
                if check.maps:
                    picture = folder / f"{check.name}.png"
                    check.write_picture(picture)
                    pictures.append(picture)
                    lines.append(f"kept: {_relative(picture, self._root)}")
        except ReferenceRtError as error:
            lines = [f"{self.fixture}: {error}"]
            self._note_error(lines[0])
        else:
            if self._noted:
                seconds = time.perf_counter() - begun
                self._note(seconds=seconds, **uses.of_checks(found, pictures))
        if lines:
            pytest.fail("\n".join(lines))
        return found


class PairGate(Gate):
    """The gate for two renderers."""

    fixture = "pair_gate"

    def __call__(
        self,
        a: Any,
        b: Any,
        *,
        scene: str | Path | None = None,
        judged: bool = False,
        spp: int | None = None,
        limit: float | None = None,
        noise_free: bool = False,
        rim: int = 0,
    ) -> "Case":
        """Fail the test unless the pictures of two renderers, builds, back ends or versions agree.

        a, b: as `candidate` of `image_gate`, replicate k of both with the same seed, so that random
        numbers that are shared are found;  scene: what both show, a file relative to the root
        folder, for the causes;  judged: our pictures of it say who is wrong;  spp: samples per
        pixel of a replicate;  limit, noise_free, rim: as of `image_gate`.

        Pictures that are too noisy to tell fail too.  Returns the
        `comparisons.results.case.Case`.
        """
        __tracebackhide__ = True

        def case_of(pictures: "list[Picture]", name: str) -> "Case":
            from comparisons.gate.pair import Asked, pair_case
            from comparisons.gate.pictures_in import pictures_of
            from reference_rt.rendering.scene import Scene

            known = None if scene is None else Scene.load(self._root / scene)
            margin = self._limit if limit is None else limit
            asked = Asked(margin, name, known, spp, judged, noise_free, rim)
            return pair_case(pictures, pictures_of(b), asked)

        return self._judge(a, case_of)


def _pictures(given: Any, folder: Path) -> "list[tuple[Picture, Path | None]]":
    """The pictures in `given`; for those from arrays also the file in `folder` that they are saved
    to if they fail, so that they can be inspected and accepted.  Raises ImageError."""
    from comparisons.gate.pictures_in import pictures_of

    found: list[tuple[Picture, Path | None]] = []
    for one in given if isinstance(given, list | tuple) else [given]:
        for picture in pictures_of(one):
            if isinstance(one, str | Path):
                found.append((picture, None))
                continue
            path = folder / f"candidate-{len(found):02d}.exr"
            found.append((replace(picture, name=str(path)), path))
    return found


def _kept(given: "Sequence[tuple[Picture, Path | None]]") -> tuple[list[str], list[str]]:
    """Save the pictures that came as arrays; lines that say where, and why not."""
    from reference_rt.util.errors import ReferenceRtError

    try:
        kept = _keep(given)
    except ReferenceRtError as error:
        return [], [f"not kept: {error}"]
    return ([f"kept: {', '.join(kept)}"] if kept else []), []


def _keep(given: "Sequence[tuple[Picture, Path | None]]") -> list[str]:
    """Save the pictures that came as arrays; return their files.  Raises ImageError."""
    from reference_rt.core.exr import write_exr

    for picture, path in given:
        if path is not None:
            channels = {name: picture.radiance[..., k] for k, name in enumerate("RGB")}
            if picture.opacity is not None:
                channels["A"] = picture.opacity
            write_exr(path, channels, {})
    return [str(path) for _, path in given if path is not None]


def _relative(path: Path, root: Path) -> Path:
    """`path` relative to the root folder, if it is below it."""
    return path.relative_to(root) if path.is_relative_to(root) else path


def _message(case: "Case", folder: Path, fixture: str) -> str:
    """The message of a failed test: the headline, cause, reason, numbers, and paths of the
    outputs."""
    from comparisons.results.headline import headline

    lines = [f"{fixture}: {case.verdict}: {headline(case)}"]
    if case.cause is not None:
        lines.append(f"{case.cause.name}: {case.cause.evidence}")
    lines.append(case.reason)
    if case.metrics is not None:
        found = case.metrics
        bias = ", ".join(f"{100.0 * b:+.3g} %" for b in found.mean_bias)
        lines.append(
            f"bias of the mean (R, G, B): {bias}; SSIM {found.ssim:.4f}, FLIP {found.flip:.4f}, "
            f"PSNR {found.psnr:.1f} dB, RMSE {found.rmse:.3g}, relMSE {found.relmse:.3g}"
        )
    lines += [
        f"{place.width} x {place.height} pixels at ({place.x}, {place.y}): {place.what}"
        for place in case.worst[:3]
    ]
    lines.append(f"pictures: {folder / 'pictures.exr'}; page: {folder / 'report.html'}")
    return "\n".join(lines)
