"""Files of compiled kernels that several processes use, at once or after one is killed."""

import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack

import numba
import pytest

from reference_rt.jit import kernel_cache

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")

_KERNEL = """
import os, signal, sys
from pathlib import Path
import numpy as np
from reference_rt.jit.kernel import entry_kernel

@entry_kernel
def halve(x):
    x[0] *= 0.5

@entry_kernel
def double(x):
    x[0] *= 2.0

def run():
    x = np.ones(1)
    halve(x)
    assert x[0] == 0.5
    return sum(halve.stats.cache_hits.values())
"""

_KILLED = """
def write(path, data):
    with path.open("wb") as file:
        file.write(data[:len(data) // 2])
        file.flush()
        os.kill(os.getpid(), signal.SIGKILL)

Path.write_bytes = write
"""


@pytest.fixture
def start(tmp_path):
    """start(code) begins a process that runs the code after `_KERNEL`, with an empty cache at
    first.  It is waited for, or ended, when the test ends."""
    (tmp_path / "halves.py").write_text(_KERNEL)
    with ExitStack() as ending:

        def begin(code):
            process = subprocess.Popen(
                [sys.executable, "-c", f"from halves import *\n{code}"],
                env=os.environ | {"REFERENCE_RT_CACHE": str(tmp_path / "cache")},
                cwd=tmp_path,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
            ending.enter_context(process)
            ending.callback(process.kill)
            return process

        yield begin


def _done(process):
    out, errors = process.communicate(timeout=600.0)
    assert errors == ""
    return process.returncode, out.strip()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="nothing kills so")
def test_a_writer_that_is_killed_leaves_nothing_that_is_read(start, tmp_path):
    assert _done(start(_KILLED + "run()")) == (-signal.SIGKILL, "")
    (folder,) = (tmp_path / "cache" / "kernels").iterdir()
    (left,) = folder.iterdir()
    assert left.name.startswith(".")
    assert [_done(start("print(run())")) for _ in range(2)] == [(0, "0"), (0, "1")]
    assert left.exists()  # for all that is known its writer is still at it
    long_ago = time.time() - kernel_cache._UNFINISHED_FOR - 60.0
    os.utime(left, (long_ago, long_ago))
    assert _done(start("print(run())")) == (0, "1")
    assert not left.exists()


_WRITES = """
halve._cache.load_overload = lambda *arguments: None  # what was loaded cannot be written again
run()
compiled, = halve.overloads.values()
for _ in range(100):
    halve._cache.save_overload(compiled.signature.args, compiled)
"""

_READS = """
run()
compiled, = halve.overloads.values()
for _ in range(100):
    assert halve._cache.load_overload(compiled.signature.args, halve.targetctx) is not None
"""


@pytest.mark.slow
def test_processes_write_and_read_at_the_same_time(start):
    """Each finds a whole file whenever it looks."""
    together = [start(code) for code in (_WRITES, _READS, _WRITES)]
    assert [_done(process) for process in together] == [(0, "")] * 3
    assert _done(start("print(run())")) == (0, "1")


_TWO = """
import os
import time
from pathlib import Path
import numpy as np
from reference_rt.jit import parallel_compile
from reference_rt.jit.kernel import entry_kernel, is_compiled, signature_of

@entry_kernel
def double(x):
    x[0] *= 2.0

@entry_kernel
def negate(x):
    x[0] = -x[0]

here, taken, precompile = os.getpid(), Path("taken"), parallel_compile.precompile

def one_for_the_child(kernel, signature):
    if os.getpid() != here:
        taken.touch()
    while not taken.exists():
        time.sleep(0.01)
    return precompile(kernel, signature)

def main():
    parallel_compile.precompile = one_for_the_child
    x = np.array([3.0])
    calls = [(kernel, signature_of(x)) for kernel in (double, negate)]
    before = [is_compiled(*call) for call in calls]
    parallel_compile.precompile_all(calls, threads=2)
    double(x)
    negate(x)
    hits = sum(sum(k.stats.cache_hits.values()) for k in (double, negate))
    print(before, "some" if hits > 0 else "none", x)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is one process")
def test_what_others_compile_is_found_in_the_cache(tmp_path):
    """By this process; the next one finds all."""
    (tmp_path / "two.py").write_text(_TWO)
    for before in (False, True):
        done = subprocess.run(
            [sys.executable, "-c", "import two; two.main()"],
            env=os.environ | {"REFERENCE_RT_CACHE": str(tmp_path / "cache")},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.strip() == f"{[before] * 2} some [-6.]"


_HELD = """
import time
from reference_rt.jit import parallel_compile
from reference_rt.jit.kernel import signature_of

def noting(kernel, name, until):
    compile_it = kernel._compiler.compile

    def compile(*types):
        print(name, flush=True)
        while until and not Path(until).exists():
            time.sleep(0.01)
        return compile_it(*types)

    kernel._compiler.compile = compile

noting(halve, "halve", HOLD)
noting(double, "double", None)
parallel_compile.may_fork = lambda: False
calls = [(kernel, signature_of(np.ones(1))) for kernel in (halve, double)]
parallel_compile.precompile_all(calls, 2)
run()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no locks")
@pytest.mark.parametrize("is_killed", [False, True])
def test_what_another_process_compiles_is_waited_for(is_killed, start, tmp_path):
    """The second process begins with the kernel that the first one is not at.  If the first one is
    killed, the second compiles that, too."""
    first = start(_HELD.replace("HOLD", "'release'"))
    assert first.stdout.readline() == "halve\n"  # it holds
    second = start(_HELD.replace("HOLD", "None"))
    assert second.stdout.readline() == "double\n"
    if is_killed:
        first.kill()
        first.wait()
    else:
        (tmp_path / "release").touch()
        assert _done(first) == (0, "")  # it finds `double` in the cache
    assert _done(second) == (0, "halve" if is_killed else "")
