"""Files of compiled kernels: a damaged one is never used, and is replaced."""

import errno
import os
import random
import shutil
import time
from collections import namedtuple
from pathlib import Path

import numba
import numpy as np
import pytest

from reference_rt.jit import kernel as kernel_module
from reference_rt.jit import kernel_cache
from reference_rt.jit.kernel import entry_kernel, is_compiled, signature_of
from reference_rt.util.errors import CacheWarning

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")


def thrice(x):
    x[0] *= 3.0


SIGNATURE = signature_of(np.ones(1))


class Kept:
    """`thrice`, compiled into a folder of its own."""

    def __init__(self, folder):
        self.folder = folder
        self.fresh()(np.ones(1))
        self.dispatcher = self.fresh()
        (self.path,) = folder.iterdir()
        self.whole = self.path.read_bytes()

    def fresh(self):
        """The function as another process has it: with nothing in memory."""
        return entry_kernel(thrice)

    def is_found(self):
        cache, target = self.dispatcher._cache, self.dispatcher.targetctx
        return cache.load_overload(SIGNATURE, target) is not None

    def heals(self):
        """Compiled by the next process, found by the one after it."""
        for hits in (0, 1):
            compiled, x = self.fresh(), np.ones(1)
            compiled(x)
            if (x[0], sum(compiled.stats.cache_hits.values())) != (3.0, hits):
                return False
        return sorted(self.folder.iterdir()) == [self.path]


@pytest.fixture
def kept(monkeypatch, tmp_path):
    folder = tmp_path / "kernels" / "a version"
    folder.mkdir(parents=True)
    monkeypatch.setattr(kernel_module, "CACHE_FOLDER", str(folder))
    return Kept(folder)


def test_a_whole_file_is_found(kept):
    assert kept.is_found()
    assert is_compiled(kept.fresh(), SIGNATURE)
    assert not is_compiled(kept.fresh(), signature_of(np.ones(1, np.float32)))


def test_no_damage_is_taken_for_a_kernel(kept):
    """Every byte of what stands before the payload, and bytes all over the payload, with one bit
    changed; the file cut at places all over it; bytes added."""
    rng = random.Random(1)
    size = len(kept.whole)
    head = kept.whole.index(kept.folder.name.encode()) + len(kept.folder.name) + 32
    assert size > 10 * head
    damaged = []
    for place in [*range(head), *rng.sample(range(head, size), 500), size - 1]:
        data = bytearray(kept.whole)
        data[place] ^= 1 << rng.randrange(8)
        damaged.append(bytes(data))
    cuts = [0, 1, head - 1, head, head + 1, size // 2, size - 1, *rng.sample(range(size), 50)]
    damaged += [kept.whole[:cut] for cut in cuts]
    damaged += [kept.whole + b"\0", b"\0" * size, kept.whole[1:], kept.whole * 2]
    for data in damaged:
        kept.path.write_bytes(data)
        assert not kept.is_found()
        assert not kept.path.exists()
    assert kept.heals()


def _of_another_version(kept):
    other = kernel_cache.KernelCache(thrice, str(kept.folder.with_name("another one")))
    payload = kept.dispatcher._cache._opened(kept.whole)
    kept.path.write_bytes(other._sealed(payload))


def _of_another_kernel(kept):
    """Whole and of this version, under a name that is not its own."""
    compiled = entry_kernel(thrice)
    compiled(np.ones(1, np.float32))
    (other,) = set(kept.folder.iterdir()) - {kept.path}
    other.replace(kept.path)


def _no_kernel_inside(kept):
    """The checksum is right, and what it is of cannot be used."""
    cache = kept.dispatcher._cache
    kept.path.write_bytes(cache._sealed(b"no pickle"))


def _a_folder(kept):
    kept.path.unlink()
    (kept.path / "folder").mkdir(parents=True)
    (kept.path / "file").write_text("")


def _unreadable(kept):
    kept.path.unlink()
    kept.path.symlink_to(kept.path.name)  # to itself: root could read what nobody else may


@pytest.mark.parametrize(
    "happens", [_of_another_version, _of_another_kernel, _no_kernel_inside, _a_folder, _unreadable]
)
def test_what_cannot_be_used_is_replaced(happens, kept):
    happens(kept)
    assert not kept.is_found()
    assert kept.heals()


def test_an_emptied_cache_is_filled_again(kept):
    shutil.rmtree(kept.folder)
    assert kept.heals()
    assert kept.folder.stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EACCES, errno.EROFS])
def test_what_cannot_be_written_is_compiled_each_time(error, kept, monkeypatch):
    def write(path, data):
        with path.open("wb") as file:
            file.write(data[: len(data) // 2])
        raise OSError(error, os.strerror(error))

    kept.path.unlink()
    with monkeypatch.context() as full:
        full.setattr(Path, "write_bytes", write)
        x = np.ones(1)
        kept.fresh()(x)
        assert x[0] == 3.0
        assert list(kept.folder.iterdir()) == []
    assert kept.heals()


def test_tuples_of_one_name_are_distinguished(kept):
    def of(name):
        return signature_of(namedtuple(name, "x")(np.ones(1)))

    compiled = entry_kernel(lambda pair: None)
    first, second = of("Pair"), of("Pair")
    assert (repr(first), first == second) == (repr(second), False)
    compiled.compile(first)
    cache, target = compiled._cache, compiled.targetctx
    assert cache.load_overload(first, target) is not None
    assert cache.load_overload(second, target) is None


def test_what_a_function_closes_over_is_part_of_it(kept):
    def times(factor):
        def scale(x):
            x[0] *= factor

        return scale

    for factor, hits in ((2.0, 0), (5.0, 0), (2.0, 1)):
        compiled, x = entry_kernel(times(factor)), np.ones(1)
        compiled(x)
        assert (x[0], sum(compiled.stats.cache_hits.values())) == (factor, hits)


def test_a_function_of_no_file_is_compiled(kept):
    """As one typed into a console: nothing would tell when it changes."""
    names = {}
    exec("def double(x):\n    x[0] *= 2.0", names)
    x = np.ones(1)
    compiled = entry_kernel(names["double"])
    assert not is_compiled(compiled, SIGNATURE)
    compiled(x)
    assert x[0] == 2.0
    assert list(kept.folder.iterdir()) == [kept.path]


# ---- the folder ---------------------------------------------------------------------------------


@pytest.fixture
def kernels(monkeypatch, tmp_path):
    """The folder of all versions' folders."""
    monkeypatch.setenv("REFERENCE_RT_CACHE", str(tmp_path))
    (tmp_path / "kernels").mkdir()
    return tmp_path / "kernels"


def test_other_versions_are_deleted_when_they_are_old(kernels):
    long_ago = time.time() - kernel_cache._UNUSED_FOR - 60.0
    for name in ("old", "new"):
        (kernels / name).mkdir()
        (kernels / name / "file").write_text("")
    (kernels / "file").write_text("")
    for name in ("old", "file"):
        os.utime(kernels / name, (long_ago, long_ago))
    folder = Path(kernel_cache.prepare_folder())
    assert set(kernels.iterdir()) == {folder, kernels / "new"}
    assert folder.stat().st_mode & 0o077 == 0


def test_an_edit_of_a_source_gives_another_folder_unless_it_is_of_the_command_line(
    kernels, monkeypatch
):
    """Kernels call each other across folders: a source in any of them is part of the machine code,
    and so are its place and its name.  The command line holds no kernel."""
    whole = Path(kernel_cache.__file__).parents[1]
    package = kernels.parent / "package"
    shutil.copytree(whole, package, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(kernel_cache, "_PACKAGE", package)
    found = [kernel_cache.prepare_folder()]
    one_of_each_folder = {path.parent: path for path in sorted(package.rglob("*.py"))}
    assert {package, package / "jit", package / "shapes" / "curved"} <= set(one_of_each_folder)
    command_line = one_of_each_folder.pop(package / "cli")
    command_line.write_text("edited")
    assert kernel_cache.prepare_folder() == found[0]
    for path in one_of_each_folder.values():
        path.write_text(path.read_text() + "# edited\n")
        found.append(kernel_cache.prepare_folder())
        path.rename(path.with_stem("renamed"))
        found.append(kernel_cache.prepare_folder())
    assert len(set(found)) == len(found) > 40


@pytest.mark.parametrize("what", ["file", "link to nothing"])
def test_what_stands_in_the_place_of_the_folder_is_replaced(what, kernels):
    folder = Path(kernel_cache.prepare_folder())
    folder.rmdir()
    if what == "file":
        folder.write_text("")
    else:
        folder.symlink_to("nowhere")
    assert kernel_cache.prepare_folder() == str(folder)
    assert folder.is_dir()


def test_links_to_nothing_keep_nobody_from_the_cache(kernels):
    (kernels / "link").symlink_to("nowhere")
    assert kernel_cache.prepare_folder() is not None


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners")
@pytest.mark.parametrize("up", [0, 1, 2])
@pytest.mark.parametrize("mode", [0o770, 0o707, None])
def test_what_others_may_write_is_not_run(mode, up, kernels, monkeypatch):
    """An entry with a right checksum is machine code of whoever wrote it.  mode: None of another
    owner."""
    folder = Path(kernel_cache.prepare_folder())
    stranger = (folder, *folder.parents)[up]
    if mode is not None:
        stranger.chmod(mode)
    else:
        of_path = Path.stat

        def stat(path, **options):
            found = list(of_path(path, **options))
            found[4] += path == stranger  # st_uid
            return os.stat_result(found)

        monkeypatch.setattr(Path, "stat", stat)
    with pytest.warns(CacheWarning, match=f"^kernels are not cached: {stranger} belongs") as said:
        assert kernel_cache.prepare_folder() is None
    assert "\n" not in str(said[0].message)
