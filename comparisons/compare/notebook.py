"""A case that shows itself in notebooks, and writes its page."""

import os
from dataclasses import fields
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.report import write_report
from comparisons.report.biases import biases_of
from comparisons.report.page import FAILED, SIGNS
from comparisons.report.thumbnails import BLUE, RED, WHITE, png_url
from comparisons.report.values import shown
from comparisons.results.case import Case, FloatArray, Images
from comparisons.results.headline import headline
from comparisons.results.naming import named
from comparisons.runs.provenance import provenance
from comparisons.statistics.metrics import encode, nonfinite_pixels, white_level

WIDTH = 280
"""Pixels of a picture's width in a notebook, at most."""

_Z_SPAN = 5.0
"""Standard errors at which the difference is full red or blue."""


class NotebookCase(Case):
    """The result for one scene, with a view in notebooks."""

    @classmethod
    def of(cls, case: Case) -> "NotebookCase":
        """The same case, with that view."""
        return cls(**{field.name: getattr(case, field.name) for field in fields(case)})

    def __repr__(self) -> str:
        return f"<Case {self.scene}: {self.verdict}: {headline(self)}>"

    def write_page(self, path: str | os.PathLike[str]) -> None:
        """Write the case as one offline HTML page, with all rungs and float pictures."""
        write_report(Path(path), [self], provenance())

    def _repr_html_(self) -> str:
        """The verdict, the pictures, and a line for each rung."""
        colour = "#a81b1b" if self.verdict in FAILED else "#1a6b35"
        sentence = escape(named(headline(self), self.sides))
        rows = "".join(
            f"<tr><td>{escape(rung.name)}</td><td>{SIGNS[rung.status]} {rung.status}</td>"
            f'<td style="text-align:left">{folded(named(rung.reason, self.sides))}</td></tr>'
            for rung in self.rungs
        )
        numbers = "" if self.metrics is None else self._numbers()
        return (
            f'<div><p><b style="color:{colour}">{SIGNS[self.verdict]} {self.verdict}</b> '
            f"<b>{escape(self.scene)}</b>: {sentence}.</p>"
            f"{self._found()}{self._pictures()}{numbers}"
            f"<table><tr><th>rung</th><th>status</th><th>reason</th></tr>{rows}</table></div>"
        )

    def _found(self) -> str:
        """The numbers of the statistics as a table."""
        table = biases_of(self)
        if table is None:
            return ""
        rows: list[tuple[str, list[Any]]] = [("th", table.head)]
        rows += [("td", row) for row in table.cells]
        body = "".join(
            f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in row)}</tr>"
            for tag, row in rows
        )
        return f"<table>{body}</table>"

    def _numbers(self) -> str:
        assert self.metrics is not None
        names = {"SSIM": "ssim", "FLIP": "flip", "PSNR, dB": "psnr", "RMSE": "rmse"}
        parts = [f"{name} {shown(getattr(self.metrics, key))}" for name, key in names.items()]
        return f"<p>{', '.join(parts)}</p>"

    def _pictures(self) -> str:
        images = self.images
        if images is None or not images.candidate.size or not images.reference.size:
            return ""
        white = white_level(images.reference)
        found = [
            (self.sides[0], exposed(images.candidate, white)),
            (self.sides[1], exposed(images.reference, white)),
        ]
        if images.candidate.shape == images.reference.shape:
            found.append(difference(images))
        style = "display:inline-block;margin:0 8px 8px 0;vertical-align:top"
        return "".join(
            f'<figure style="{style}"><img style="max-width:{WIDTH}px;min-width:128px;'
            f'image-rendering:pixelated" alt="{escape(title)}" src="{png_url(pixels)}">'
            f"<figcaption>{escape(title)}</figcaption></figure>"
            for title, pixels in found
        )


def folded(reason: str) -> str:
    """A reason as HTML: its first clause, which unfolds to the whole."""
    clause, _, rest = reason.partition("; ")
    if not rest:
        return escape(reason)
    return f"<details><summary>{escape(clause)}</summary>{escape(rest)}</details>"


def exposed(image: FloatArray, white: float) -> FloatArray:
    """Pixels from 0 to 255; those that are not finite are magenta."""
    bad = np.asarray(nonfinite_pixels(image))[..., None]
    return np.where(bad, (255.0, 0.0, 255.0), 255.0 * encode(np.where(bad, 0.0, image), white))


def difference(images: Images) -> tuple[str, FloatArray]:
    """Title and pixels from 0 to 255 of candidate minus reference, in standard errors if they are
    known: red where the candidate is brighter, of the channel that differs most."""
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        values = images.candidate - images.reference
        if images.error is not None:
            values = np.where(values == 0.0, 0.0, values / images.error)
    bad = np.asarray(np.isnan(values).any(axis=-1))
    most = np.abs(np.where(bad[..., None], 0.0, values)).argmax(axis=-1)[..., None]
    largest = np.where(bad, 0.0, np.take_along_axis(values, most, axis=-1)[..., 0])
    finite = np.abs(largest[np.isfinite(largest)])
    span = _Z_SPAN
    if images.error is None:
        span = float(finite.max()) if finite.size and finite.max() > 0.0 else 1.0
    amount = np.clip(largest / span, -1.0, 1.0)[..., None]
    end = np.where(amount > 0.0, RED, BLUE)
    pixels = WHITE + np.abs(amount) * (end - np.array(WHITE))
    unit = "standard errors" if images.error is not None else "W·sr⁻¹·m⁻²"
    title = f"difference, −{shown(span)} to +{shown(span)} {unit}"
    return title, np.where(bad[..., None], (255.0, 0.0, 255.0), pixels)
