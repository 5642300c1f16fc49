"""Child processes never outlive their parent, whether a signal ends it or it is killed."""

import ast
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import comparisons
import reference_rt

SCENES = Path(__file__).parents[3] / "scenes"
SECONDS = 600.0

linux = pytest.mark.skipif(sys.platform != "linux", reason="asks Linux for processes")


def alive(process: int) -> bool:
    """Whether it runs: what is dead may wait for somebody to ask for its exit code."""
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state not in "ZX"


def await_true(what, condition):
    end = time.monotonic() + SECONDS
    while not (found := condition()):
        assert time.monotonic() < end, f"{what}: not within {SECONDS} s"
        time.sleep(0.02)
    return found


def below(process: int) -> list[int]:
    """The children of a process, and theirs."""
    found = []
    for tasks in Path(f"/proc/{process}/task").glob("*/children"):
        try:
            for child in map(int, tasks.read_text().split()):
                found += [child, *below(child)]
        except OSError:
            pass
    return found


_processes: list["subprocess.Popen[str]"] = []


@pytest.fixture(autouse=True)
def _ended():
    yield
    while _processes:
        process = _processes.pop()
        process.kill()
        process.communicate()


def begun(arguments, folder, **environment):
    process = subprocess.Popen(
        arguments,
        cwd=folder,
        env=os.environ | {"REFERENCE_RT_CACHE": str(folder / "cache")} | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    )
    _processes.append(process)
    return process


PROGRAM = [sys.executable, "-c", "from reference_rt.cli.main import main; main()"]

RENDERER = """
import os, subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
with open("began.tmp", "w") as file:
    file.write(f"{os.getpid()} {child.pid}")
os.rename("began.tmp", "began")
time.sleep(600)
"""
"""A renderer that hangs, with a child."""

WORKER = """
import sys, time
from pathlib import Path
sys.stdin.readline()
Path("began").write_text(str(__import__("os").getpid()))
time.sleep(600)
"""

POOL = """
import sys
from comparisons.runs.processes import run
from reference_rt.util.workers import Threads
class Asked:
    def model_dump_json(self):
        return "{}"
for outcome in run([Asked()], Threads(1), 600.0, lambda request, step: None, ["worker"]):
    pass
"""


def gate(folder):
    (folder / "renderer.py").write_text(RENDERER)
    (folder / "scene.yaml").write_text("film: {width: 4, height: 4}\n")
    command = f"{shlex.quote(sys.executable)} renderer.py {{output}}"
    process = begun([*PROGRAM, "gate", "--command", command, "--scene", "scene.yaml"], folder)
    began = await_true("the renderer begins", (folder / "began").exists)
    assert began
    children = [int(n) for n in (folder / "began").read_text().split()]
    # The guard begins after the renderer.
    await_true("the guard begins", lambda: len(below(process.pid)) > 2)
    return process, sorted({*children, *below(process.pid)})


def pool(folder):
    (folder / "worker.py").write_text(WORKER)
    process = begun([sys.executable, "-c", POOL], folder, PYTHONPATH=str(folder))
    await_true("the worker begins", lambda: below(process.pid) and (folder / "began").exists())
    return process, below(process.pid)


def compiling(folder):
    scene = str(SCENES / "mesh_knot.yaml")
    process = begun([*PROGRAM, "render", scene, "-o", "out.png", "--threads", "2"], folder)
    await_true("a second process compiles", lambda: below(process.pid))
    return process, below(process.pid)


@pytest.mark.slow
@linux
@pytest.mark.parametrize(
    ("start", "number"),
    [
        *((gate, number) for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)),
        *((pool, number) for number in (signal.SIGTERM, signal.SIGKILL)),
        *((compiling, number) for number in (signal.SIGTERM, signal.SIGKILL)),
    ],
)
def test_no_child_outlives_its_parent(tmp_path, start, number):
    process, children = start(tmp_path)
    assert children
    assert all(map(alive, children))
    process.send_signal(number)
    _, errors = process.communicate(timeout=SECONDS)
    await_true("the children end", lambda: not any(map(alive, children)))
    if number == signal.SIGKILL or start is pool:  # the pool is not within the program
        assert process.returncode == -number
    else:
        assert process.returncode == 128 + number
        assert errors.splitlines()[-1] == "error: interrupted; nothing unfinished was written"
        assert "Traceback" not in errors
    assert not (tmp_path / "out.png").exists()


@pytest.mark.slow
@linux
def test_nohup_goes_on(tmp_path):
    """Who has SIGHUP ignored, keeps that."""
    code = "import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
    code += "import os, reference_rt.cli.main as c\n"
    code += "app = c.app; c.app = lambda: (os.kill(os.getpid(), signal.SIGHUP), app())\n"
    code += "import sys; sys.argv[1:] = ['schema']; c.main()"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert json.loads(done.stdout)["title"] == "Scene"


def started_in(source):
    """Calls of subprocess in a source, each with whether it is tied to the parent."""
    text = source.read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(text)) if "subprocess" in text else ():
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Attribute)
            and isinstance(node.func.value, ast.Name)
            and node.func.value.id == "subprocess"
            and node.func.attr in ("run", "Popen", "check_output", "check_call", "call")
        ):
            options = [ast.unparse(k.value) for k in node.keywords if k.arg is None]
            yield f"{source.name}:{node.lineno}", "tied()" in options


def test_every_process_is_tied():
    """But what watches renderers, which is there to outlive its parent, and what it starts."""
    found = dict(
        call
        for package in (reference_rt, comparisons)
        for source in sorted(Path(package.__file__).parent.rglob("*.py"))
        for call in started_in(source)
    )
    assert len(found) >= 10
    loose = [where for where, is_tied in found.items() if not is_tied]
    assert [where.partition(":")[0] for where in loose] == ["driver.py", "supervisor.py"]
