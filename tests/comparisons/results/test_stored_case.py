"""Stored results of cases: read back as they were written; damaged ones are refused."""

import dataclasses
import json
import math

import numpy as np
import pytest

from comparisons.results.case import Case, Cause, ImageRegion, Images, Metrics, RungResult
from comparisons.results.stored_case import (
    CASE,
    PICTURES,
    StoredCaseError,
    read_case,
    read_stored_case,
    write_case,
)
from reference_rt.core.exr import read_exr
from reference_rt.util.errors import ImageError

RNG = np.random.default_rng(5)


def case(images=None, **changes):
    numbers = {
        "count": 3,
        "array": np.arange(4.0),
        "nested": {"worst": math.inf, "list": [math.nan, {"deep": -math.inf}], "none": None},
        "numpy": np.float64(0.1),
        "flag": np.bool_(True),
        "text": "é✓\x00\udc80",
    }
    made = Case(
        "scene",
        "differ",
        "geometry: 1 ray of 3 differs",
        (RungResult("geometry", "differ", "1 ray", numbers), RungResult("images", "agree", "same")),
        Metrics(math.nan, 0.1, math.inf, 0.5, 1e300, (0.0, -math.inf, -0.01), 0),
        {"candidate": {"load": 0.1}, "reference": {}},
        images,
        ("a note",),
        ("yours", "ours"),
        Cause("half-pixel shift", "0.5 pixels", 0.99),
        (ImageRegion(1, 2, 3, 4, "darker"),),
        ("textures: none",),
        "reference-rt suite smoke --only scene",
    )
    return dataclasses.replace(made, **changes)


def same(a, b):
    """Equal, NaN to NaN."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    return a == b or (a != a and b != b)


def test_everything_but_pictures_comes_back_exactly(tmp_path):
    written = case()
    write_case(tmp_path, written, "key", 1.25)
    read = read_case(tmp_path)
    for field in dataclasses.fields(Case):
        if field.name not in ("rungs", "metrics"):
            assert getattr(read, field.name) == getattr(written, field.name), field.name
    assert same(dataclasses.astuple(read.metrics), dataclasses.astuple(written.metrics))
    expected = dict(written.rungs[0].numbers)
    expected |= {"array": [0.0, 1.0, 2.0, 3.0], "numpy": 0.1, "flag": True}
    assert same(read.rungs[0].numbers, expected)
    assert read.rungs[1] == written.rungs[1]
    record = read_stored_case(tmp_path)
    assert (record.key, record.wall) == ("key", 1.25)
    assert not (tmp_path / PICTURES).exists()


def test_the_record_is_strict_json(tmp_path):
    write_case(tmp_path, case())

    def refuse(name):
        raise AssertionError(name)

    json.loads((tmp_path / CASE).read_text(encoding="utf-8"), parse_constant=refuse)


@pytest.mark.parametrize("with_error", [False, True])
def test_pictures_come_back_as_float32(tmp_path, with_error):
    candidate = RNG.normal(size=(5, 7, 3))
    candidate[0, 0] = math.nan, math.inf, -math.inf
    candidate[1, 1, 0] = 1e-50
    error = RNG.random((5, 7, 3)) if with_error else None
    layers = {"normal": (RNG.random((5, 7, 3)), RNG.random((3, 2, 3)))} if with_error else {}
    images = Images(candidate, RNG.random((5, 7, 3)), error, layers=layers)
    write_case(tmp_path, case(images))
    read = read_case(tmp_path).images
    for name in ("candidate", "reference", "error"):
        before, after = getattr(images, name), getattr(read, name)
        if before is None:
            assert after is None
        else:
            assert after.dtype == np.float64
            np.testing.assert_array_equal(after, before.astype(np.float32))
    assert read.layers.keys() == layers.keys()
    for after, before in zip(read.layers.get("normal", ()), layers.get("normal", ()), strict=True):
        np.testing.assert_array_equal(after, before.astype(np.float32))
    channels, header = read_exr(tmp_path / PICTURES)
    assert set(channels) >= {f"{p}.{c}" for p in ("candidate", "reference") for c in "RGB"}
    assert header["scene"] == "scene"


def test_pictures_may_differ_in_size(tmp_path):
    images = Images(RNG.random((2, 9, 3)), RNG.random((6, 4, 3)))
    write_case(tmp_path, case(images))
    read = read_case(tmp_path).images
    np.testing.assert_array_equal(read.candidate, images.candidate.astype(np.float32))
    np.testing.assert_array_equal(read.reference, images.reference.astype(np.float32))


def test_a_record_replaces_the_former_one_with_its_pictures(tmp_path):
    write_case(tmp_path, case(Images(np.ones((2, 2, 3)), np.ones((2, 2, 3)))))
    write_case(tmp_path, case(reason="geometry: other"))
    assert read_case(tmp_path).reason == "geometry: other"
    assert [p.name for p in tmp_path.iterdir()] == [CASE]


def test_pictures_of_another_record_are_refused(tmp_path):
    """What an interruption between the two files leaves."""
    write_case(tmp_path / "a", case(Images(np.ones((2, 2, 3)), np.ones((2, 2, 3)))))
    write_case(tmp_path / "b", case(Images(np.ones((2, 2, 3)), np.zeros((2, 2, 3)))))
    (tmp_path / "b" / PICTURES).replace(tmp_path / "a" / PICTURES)
    with pytest.raises(StoredCaseError, match=r"pictures\.exr: does not have the checksum"):
        read_case(tmp_path / "a")


def test_a_full_disk_leaves_the_former_record(tmp_path, monkeypatch):
    write_case(tmp_path, case(reason="geometry: former"))

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(ImageError, match="No space left"):
        write_case(tmp_path, case())
    monkeypatch.undo()
    assert read_case(tmp_path).reason == "geometry: former"
    assert [p.name for p in tmp_path.iterdir()] == [CASE]


def change(key, value):
    def edit(document):
        document[key] = value

    return edit


def drop_reason(document):
    del document["case"]["reason"]


@pytest.mark.parametrize(
    "edit",
    [
        change("schema", 0),
        change("extra", 1),
        change("case", []),
        change("case", {}),
        change("pictures", {"candidate": [2]}),
        change("pictures", {"candidate": [2, 2]}),
        change("pictures", {"unknown": [2, 2]}),
        change("sha256", "0"),
        change("key", 3),
        drop_reason,
        lambda document: document["case"].update(verdict="fine"),
        lambda document: document["case"].update(rungs=3),
        lambda document: document["case"].update(unknown=3),
    ],
)
def test_what_was_edited_is_refused_in_one_line(tmp_path, edit):
    write_case(tmp_path, case(Images(np.ones((2, 2, 3)), np.ones((2, 2, 3)))))
    document = json.loads((tmp_path / CASE).read_text())
    edit(document)
    (tmp_path / CASE).write_text(json.dumps(document))
    with pytest.raises(StoredCaseError) as error:
        read_case(tmp_path)
    assert "\n" not in str(error.value)
    assert str(tmp_path) in str(error.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "3", "null", '"x"', "\udcff", "[" * 100_000])
def test_what_is_no_record_is_refused(tmp_path, text):
    (tmp_path / CASE).write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(StoredCaseError, match=r"case\.json"):
        read_case(tmp_path)


def test_truncated_files_are_refused(tmp_path):
    write_case(tmp_path, case(Images(RNG.random((9, 9, 3)), RNG.random((9, 9, 3)))))
    for name in (CASE, PICTURES):
        whole = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(whole[: len(whole) // 2])
        with pytest.raises(ImageError, match=name):
            read_case(tmp_path)
        (tmp_path / name).write_bytes(whole)
    read_case(tmp_path)
    (tmp_path / PICTURES).unlink()
    with pytest.raises(StoredCaseError, match="cannot be read: No such file"):
        read_case(tmp_path)
    with pytest.raises(StoredCaseError, match="cannot be read: No such file"):
        read_case(tmp_path / "nowhere")


def test_a_picture_of_another_shape_is_a_mistake_of_the_caller(tmp_path):
    with pytest.raises(ValueError, match="candidate: expected"):
        write_case(tmp_path, case(Images(np.ones((2, 2)), np.ones((2, 2, 3)))))
