"""Files of photometry (IESNA LM-63): each year's, written by hand, and damaged ones."""

import math
import random

import numpy as np
import pytest
from photometry import OF_1991, OF_2002, READ

from reference_rt.lights import lm63
from reference_rt.lights.lm63 import Photometry, parse, read_photometry


def of(year: str) -> bytes:
    return READ[year][0].encode("latin-1")


def agrees(found: Photometry, year: str) -> None:
    _, vertical, horizontal, candelas, opening, unit = READ[year]
    assert found.vertical.tolist() == vertical
    assert found.horizontal.tolist() == horizontal
    np.testing.assert_allclose(found.candelas, candelas, rtol=1e-15)
    assert found.opening == pytest.approx(np.multiply(opening, unit))
    assert not found.tilts


@pytest.mark.parametrize("year", READ)
def test_files_of_each_year(year: str) -> None:
    """Factors are the multiplier and that of the ballast; until 1991 the third one, too, which is
    no factor any more: reserved in 1995 and 2002, and the kind of the measurement in 2019."""
    agrees(parse(of(year)), year)


@pytest.mark.parametrize("year", READ)
@pytest.mark.parametrize("end", ["\r\n", "\r", "\n\n", "   \n", "\r\n\x1a"])
def test_ends_of_lines(year: str, end: str) -> None:
    if year == "1986" and end == "\n\n":
        end = "\n"
    content = of(year).replace(b"\n", end.encode()) if "\x1a" not in end else of(year) + b"\r\n\x1a"
    agrees(parse(content), year)
    agrees(parse(b"\xef\xbb\xbf" + content), year)


@pytest.mark.parametrize("year", READ)
def test_lines_of_numbers_may_break_anywhere(year: str) -> None:
    head, tilt, tail = of(year).decode("latin-1").partition("TILT=")
    how, _, numbers = tail.partition("\n")
    rng = random.Random(4)
    for _ in range(20):
        words = numbers.replace(",", " ").split()
        text = "".join(word + rng.choice((" ", "\n", "\r\n", ", ", "\t", "  \n")) for word in words)
        agrees(parse(f"{head}{tilt}{how}\n{text}".encode("latin-1")), year)


def test_what_a_lamp_loses_by_tilt_is_told() -> None:
    assert parse(of("1991").replace(b"1 1 1\n", b"1 0.95 0.9\n")).tilts


def test_numbers_of_every_form() -> None:
    text = OF_2002.replace("1 2 3 4 5 6 7 8", "1. .5 +3 4e0 5.0E-1 6e+1 0 00.10")
    expected = 0.5 * np.array([1, 0.5, 3, 4, 0.5, 60, 0, 0.1]).reshape(4, 2)
    np.testing.assert_allclose(parse(text.encode()).candelas, expected, rtol=1e-15)


WRONG = {
    "nothing": (b"", "has no line 'TILT=' in 1 lines; expected an LM-63 file"),
    "another file": (b"IESNA91\n[TEST] 1\n1 2 3\n", "has no line 'TILT=' in 3 lines"),
    "not text": (b"IESNA91\0", "is not text; expected an LM-63 file"),
    "heading": (
        OF_2002.replace("LM-63-2002", "LM-63-2050").encode(),
        "line 1: unknown heading 'IESNA:LM-63-2050'; expected one of: IESNA91,",
    ),
    "tilt in a file": (
        OF_2002.replace("NONE", "lamp.tlt").encode(),
        "line 6: TILT=lamp.tlt is not supported; expected TILT=NONE or TILT=INCLUDE",
    ),
    "place of the lamp": (
        OF_1991.replace("INCLUDE\n1", "INCLUDE\n4").encode(),
        "line 6: the lamp's place in the luminaire is 4; expected an integer from 1 to 3",
    ),
    "type B": (
        OF_2002.replace("2 4 1 2", "2 4 2 2").encode(),
        "line 7: photometry of type B (2) is not supported; expected type C (1)",
    ),
    "type A": (OF_2002.replace("2 4 1 2", "2 4 3 2").encode(), "photometry of type A (3)"),
    "unit": (
        OF_2002.replace("2 4 1 2", "2 4 1 3").encode(),
        "line 7: the unit of lengths is 3; expected an integer from 1 to 2",
    ),
    "multiplier": (
        OF_2002.replace("1 -1 1 2", "1 -1 0 2").encode(),
        "line 7: the multiplier is 0; expected more than 0",
    ),
    "ballast": (
        OF_2002.replace("0.5 7", "-0.5 7").encode(),
        "line 8: the ballast factor is -0.5; expected more than 0",
    ),
    "lamp and ballast": (
        OF_1991.replace("1 0.5 75", "1 0 75").encode(),
        "line 11: the ballast-lamp photometric factor is 0; expected more than 0",
    ),
    "one angle": (
        OF_2002.replace("1 2 4 1 2", "1 1 4 1 2").encode(),
        "line 7: the number of vertical angles is 1; expected an integer from 2 to",
    ),
    "half an angle": (OF_2002.replace("1 2 4 1 2", "1 2.5 4 1 2").encode(), "angles is 2.5"),
    "many angles": (
        OF_2002.replace("1 2 4 1 2", "1 2000000000 4 1 2").encode(),
        "vertical angles is 2e+09; expected an integer from 2 to 1048576",
    ),
    "many values": (
        OF_2002.replace("1 2 4 1 2", "1 100000 100000 1 2").encode(),
        "line 7: 100000 x 100000 values; expected at most 1048576",
    ),
    "order": (
        OF_2002.replace("0 30 60 90", "0 30 30 90").encode(),
        "line 10: horizontal angle 30 follows 30; expected ascending angles",
    ),
    "vertical angles": (
        OF_2002.replace("\n0 180", "\n-90\n90").encode(),
        "line 9: vertical angle -90; expected angles from 0 to 180 degrees",
    ),
    "horizontal angles": (
        OF_2002.replace("0 30 60 90", "0 30 60 345").encode(),
        "line 10: horizontal angles from 0 to 345; expected 0 alone, 0 to 90, 0 to 180",
    ),
    "word": (
        OF_2002.replace("5 6 7", "5 six 7").encode(),
        "line 11: value 6 of 8 is 'six'; expected a number",
    ),
    "not a number": (OF_2002.replace("5 6 7", "5 nan 7").encode(), "is 'nan'; expected a number"),
    "infinite": (OF_2002.replace("5 6 7", "5 inf 7").encode(), "is 'inf'; expected a number"),
    "too large": (OF_2002.replace("5 6 7", "5 1e999 7").encode(), "expected a finite number"),
    "underscores": (OF_2002.replace("5 6 7", "5 1_0 7").encode(), "'1_0'; expected a number"),
    "other digits": (
        OF_2002.replace("5 6 7", "5 \xb2 7").encode("latin-1"), "is '\\xb2'; expected a number"
    ),
    "endless digits": (
        OF_2002.replace("5 6 7", "5 " + 1000000 * "9" + " 7").encode(),
        f"line 11: value 6 of 8 is '{37 * '9'}...'; expected a number",
    ),
    "negative": (
        OF_2002.replace("5 6 7", "5 -6 7").encode(),
        "line 11: value 6 of 8 is -6; expected at least 0",
    ),
    "overflow": (
        OF_2002.replace("5 6 7", "5 1e308 7").replace("1 -1 1 2", "1 -1 9 2").encode(),
        "the values times their factors overflow; expected smaller ones",
    ),
    "end": (
        OF_2002.replace(" 7 8\n", "").encode(),
        "line 11: the file ends before value 7 of 8; expected a number",
    ),
    "more": (OF_2002.encode() + b"9", "line 12: '9' follows the last value; expected the end"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_files(name: str) -> None:
    content, message = WRONG[name]
    with pytest.raises(ValueError) as told:  # noqa: PT011
        parse(content)
    assert message in str(told.value)


@pytest.mark.parametrize("year", READ)
def test_damaged_files_are_read_or_refused(year: str) -> None:
    """Every beginning of a file, and bytes of it changed at random: a table that is sound, or an
    error in words."""
    rng, content = random.Random(9), of(year)
    cases = [content[:k] for k in range(len(content))]
    for _ in range(400):
        damaged = bytearray(content)
        for _ in range(rng.randint(1, 4)):
            damaged[rng.randrange(len(damaged))] = rng.choice(b"0123456789-+.eE \n\r,[]\xff\x1aTI=")
        cases.append(bytes(damaged))
    told: list[str] = []
    for case in cases:
        try:
            found = parse(case)
        except ValueError as error:
            told.append(str(error))
            continue
        assert found.candelas.shape == (len(found.horizontal), len(found.vertical))
        assert np.isfinite(found.candelas).all()
        assert (found.candelas >= 0.0).all()
        assert (np.diff(found.vertical) > 0.0).all()
        assert found.vertical[-1] <= 180.0
        assert found.horizontal[-1] in (0.0, 90.0, 180.0, 270.0, 360.0)
    assert told
    assert all("; expected" in text for text in told)


def test_files_that_cannot_be_read(tmp_path, monkeypatch) -> None:
    path = tmp_path / "a.ies"
    with pytest.raises(ValueError, match=r"a.ies: cannot be read: No such file"):
        read_photometry(path)
    path.mkdir()
    with pytest.raises(ValueError, match=r"a.ies: cannot be read: Is a directory"):
        read_photometry(path)
    (file := tmp_path / "b.ies").write_bytes(OF_2002.replace("-1 1 2", "-1 x 2").encode())
    with pytest.raises(
        ValueError, match=r"b.ies: line 7: the multiplier is 'x'; expected a number"
    ):
        read_photometry(file)
    file.write_bytes(of("2002"))
    agrees(read_photometry(file), "2002")
    monkeypatch.setattr(lm63, "MOST_BYTES", 100)
    with pytest.raises(ValueError, match="has more than 100 bytes; expected an LM-63 file"):
        read_photometry(file)


def test_as_many_values_as_are_allowed() -> None:
    """A quarter of a degree between directions is read, in a few seconds at most."""
    m, k = 721, 1441
    angles = " ".join(f"{x:g}" for n in (m, k) for x in np.linspace(0, 180 if n == m else 360, n))
    values = "1 " * (m * k)
    text = f"IES:LM-63-2019\nTILT=NONE\n1 -1 1 {m} {k} 1 2 0 0 0 1 1 1 {angles}\n{values}\n"
    assert len(text) < lm63.MOST_BYTES
    found = parse(text.encode())
    assert found.candelas.shape == (k, m)
    assert math.isclose(found.horizontal[1], 0.25)
