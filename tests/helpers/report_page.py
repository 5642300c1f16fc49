"""Cases for the page, and the page read back: for its tests."""

import base64
import io
import json
import math
from html.parser import HTMLParser

import numpy as np
from PIL import Image

from comparisons.results.case import Case, Metrics, RungResult

NASTY = "<script>alert('x')</script>&\"glass\"<!-- ]]> </style>"
PROVENANCE = {"date": "2025-11-20", "mitsuba": "3.9.1 llvm_ad_rgb", "versions": {"numpy": "2.4"}}


def case(verdict, scene=None, images=None, numbers=None, **more):
    metrics = Metrics(math.nan, 0.0625, math.inf, 0.5, 0.25, (0.0, math.inf, -0.01), 0)
    rung = RungResult("geometry", verdict, f"why {verdict}", numbers or {})
    seconds = {"ours": {"load": 0.5, "render": 1.5}, "mitsuba": {"render": 2.0}}
    name = scene or f"scene-{verdict}"
    told = f"geometry: {verdict}"
    return Case(name, verdict, told, (rung,), metrics, seconds, images, ("note",), **more)


def noise(shape, seed=0):
    return np.random.default_rng(seed).lognormal(size=(*shape, 3))


class Page(HTMLParser):
    """What a page asks the network for, its headings of cases, its pictures and its scripts."""

    VOID = frozenset({"meta", "img", "input", "link", "br", "wbr"})

    def __init__(self, text):
        super().__init__()
        self.references, self.open, self.titles, self.tags, self.scripts = [], [], [], [], []
        self.handlers = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.references += [v for k, v in attrs if k in {"src", "href", "srcset", "data", "action"}]
        self.handlers += [k for k, _ in attrs if k.startswith("on")]
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == "h2":
            self.titles.append("")
        if tag == "script":
            self.scripts.append([dict(attrs)["type"], ""])

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "h2" in self.open:
            self.titles[-1] += data
        if self.open and self.open[-1] == "script":
            self.scripts[-1][1] += data

    def pixels(self, index):
        url = [r for r in self.references if r.startswith("data:")][index]
        data = base64.b64decode(url.removeprefix("data:image/png;base64,"))
        return np.asarray(Image.open(io.BytesIO(data)))

    @property
    def cases(self):
        return self.titles[:-1]  # the last one is that of the help

    @property
    def data(self):
        return [json.loads(text) for type_, text in self.scripts if type_ == "application/json"]
