"""`reference-rt trace`: text, JSON and a page of the same rays; what is refused."""

import json
import re
from html.parser import HTMLParser

import pytest
from builders import SCENES
from command_line import invoke

BALLS = str(SCENES / "whitted_classic.yaml")
"""Pixel 10, 12 of 32 x 24 has rays of a glass ball: mirrored, refracted and shadow rays."""

PLACE = (BALLS, "--size", "32x24", "--pixel", "10,12")


class Page(HTMLParser):
    """The attributes of all elements, by their names; what is open at the end."""

    def __init__(self, text):
        super().__init__()
        self.found, self.open = {}, []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.setdefault(tag, []).append(dict(attrs))
        if tag not in ("meta", "br"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.found.setdefault(tag, []).append(dict(attrs))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_text_json_and_page_show_the_same_rays(tmp_path):
    page = tmp_path / "rays.html"
    said = invoke("trace", *PLACE, "--out", page)
    assert said.exit_code == 0, said.stderr
    stored = invoke("trace", *PLACE, "--json")
    tree = json.loads(stored.stdout, parse_constant=pytest.fail)
    kinds = [ray["kind"] for ray in tree["rays"]]
    assert {"camera", "mirrored", "refracted", "shadow"} <= set(kinds)
    assert sorted(re.findall(r"(\w+) ray\b", said.stdout)) == sorted(kinds)
    shown = Page(page.read_text(encoding="utf-8"))
    assert shown.open == []
    numbers = sorted(int(line["data-ray"]) for line in shown.found["line"])
    assert numbers == sorted(3 * [*range(len(kinds))])
    inside = [float(line[end]) for line in shown.found["line"] for end in ("x2", "y2")
              if kinds[int(line["data-ray"])] == "camera"]  # fmt: skip
    assert all(0.0 <= x <= 300.0 for x in inside)
    assert len(shown.found["image"]) == 6
    assert "http" not in page.read_text()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--pixel", "3"), "--pixel: expected X,Y, such as 12,34, got '3'"),
        (("--pixel", "-1,2"), "--pixel: expected X,Y"),
        (("--size", "4x5", "--pixel", "4,4"), "expected X below 4 and Y below 5"),
        (("--pixel", "1,1", "--sample", "4096"), "--sample: there are "),
    ],
)
def test_what_there_is_not_is_refused(arguments, said, refused):
    assert said in refused(2, "trace", BALLS, *arguments)
