"""Float pictures inside the page, about 12 bytes a pixel; decoded by `unpack.js` and `unpack`.

A picture is stored as IEEE half floats times one power of two; values too large for that are listed
separately.  Pictures of the same size share the power of two, and the candidate's codes are stored
as differences from the reference's, which are small.  Half floats cannot distinguish 1.0001 from 1:
therefore the difference of the pictures is stored too, as the residual beyond the difference of the
stored pictures.

Precision after decoding: radiance 1/1024, the difference 1/64, the standard error 1/16, relative;
the latter two at worst 1e-10 of the brightest values.  NaN, infinities and zeros are exact.
"""

import base64
import json
import math
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from comparisons.results.case import FloatArray, Images

RADIANCE_BITS, REST_BITS, ERROR_BITS = 11, 6, 4
"""Significant bits, including the leading one; fewer bits compress better."""

NEAR = 1.0 / 64.0
"""Candidate values within this relative difference are stored as the stored reference plus the
difference: equal pixels then have equal codes, and the residual is the difference itself."""

HEADROOM = 7
"""Powers of two between the 99.9th percentile and the largest half float: brighter values (at most
0.1 % of all, fireflies) are listed separately."""

_LARGEST_HALF = 16
"""65504 is just below 2^16."""

Codes = npt.NDArray[np.uint16]


@dataclass(frozen=True)
class Coded:
    """A picture as half floats: value = half float · 2^exponent, or as listed in `beyond` under its
    index in the flattened picture."""

    codes: Codes
    """(height, width, 3)"""
    exponent: int
    beyond: dict[int, float]

    def decoded(self) -> FloatArray:
        values = np.ldexp(self.codes.view(np.float16).astype(np.float64), self.exponent)
        values.flat[list(self.beyond)] = list(self.beyond.values())
        return values

    def described(self) -> dict[str, Any]:
        height, width, _ = self.codes.shape
        listed = [[index, value] for index, value in self.beyond.items()]
        return {"width": width, "height": height, "exponent": self.exponent, "beyond": listed}


@dataclass(frozen=True)
class Unpacked:
    """A case's pictures as the page decodes them."""

    candidate: FloatArray
    reference: FloatArray
    difference: FloatArray | None
    error: FloatArray | None


def pack(images: Images, factor: int = 1) -> dict[str, Any]:
    """`images` as JSON: sizes, exponents and "bytes", base64 of a raw deflate stream (RFC 1951).

    With a factor above 1 the pixels are means over factor x factor of the given ones.  The stream
    holds the codes of the reference, the candidate, the rest of the difference and the standard
    error (the last two where there are any): of each first all the high bytes, then all the low
    ones, in the order rows, columns, channels.
    """
    images = reduced_images(images, factor)
    candidate, reference = images.candidate, images.reference
    comparable = candidate.shape == reference.shape
    exponent = _exponent(candidate, reference)
    kept = {"reference": coded(reference, exponent)}
    streams = [kept["reference"].codes]
    if comparable:
        kept |= _beside(candidate, reference, kept["reference"])
        streams.append(_zigzag(kept["candidate"].codes - kept["reference"].codes))
        streams.append(kept["rest"].codes)
        if images.error is not None:
            kept["error"] = coded(images.error, _exponent(images.error), ERROR_BITS)
            streams.append(kept["error"].codes)
    else:
        kept["candidate"] = coded(candidate, _exponent(candidate))
        streams.append(kept["candidate"].codes)
    described = {name: picture.described() for name, picture in kept.items()}
    return {"factor": factor, **described, "bytes": _deflated(streams)}


def unpack(data: dict[str, Any]) -> Unpacked:
    """Decode `pack`'s JSON: the same numbers as in the browser, bit for bit."""
    raw = zlib.decompress(base64.b64decode(data["bytes"]), -zlib.MAX_WBITS)
    streams = iter(_inflated(raw, data))
    reference_codes, candidate_codes = next(streams), next(streams)
    reference = _coded(data["reference"], reference_codes).decoded()
    if "rest" not in data:
        candidate = _coded(data["candidate"], candidate_codes).decoded()
        return Unpacked(candidate, reference, None, None)
    candidate_codes = reference_codes + _unzigzag(candidate_codes)
    candidate = _coded(data["candidate"], candidate_codes).decoded()
    rest = _coded(data["rest"], next(streams)).decoded()
    with np.errstate(invalid="ignore", over="ignore"):
        difference = candidate - reference + rest
    error = _coded(data["error"], next(streams)).decoded() if "error" in data else None
    return Unpacked(candidate, reference, difference, error)


def as_json(data: dict[str, Any]) -> str:
    """Strict JSON that cannot end the script element around it."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def coded(values: FloatArray, exponent: int, bits: int = RADIANCE_BITS) -> Coded:
    """`values` (height, width, 3) rounded to `bits` significant bits, at most 11."""
    significand, powers = np.frexp(values)
    with np.errstate(over="ignore", under="ignore"):
        rounded = np.ldexp(np.rint(np.ldexp(significand, bits)), powers - bits - exponent)
        halves = rounded.astype(np.float16)
    lost = np.isinf(halves) & np.isfinite(values)
    halves[lost] = 0.0
    places = np.flatnonzero(lost).tolist()
    return Coded(halves.view(np.uint16), exponent, {i: float(values.flat[i]) for i in places})


def reduced(image: FloatArray, factor: int) -> FloatArray:
    """Means over factor x factor pixels, fewer at the right and lower edge; not finite where any of
    these values is not."""
    if factor == 1:
        return image
    return _block_sums(image, factor) / _block_counts(image, factor)


def reduced_images(images: Images, factor: int) -> Images:
    """`reduced` of the pictures; pixels are independent, so their variances add up."""
    if factor == 1:
        return images
    error = images.error
    if error is not None:
        error = np.sqrt(_block_sums(error**2, factor)) / _block_counts(error, factor)
    return Images(reduced(images.candidate, factor), reduced(images.reference, factor), error)


def _block_sums(image: FloatArray, factor: int) -> FloatArray:
    with np.errstate(invalid="ignore", over="ignore"):
        rows = np.add.reduceat(image, np.arange(0, image.shape[0], factor), axis=0)
        columns = np.arange(0, image.shape[1], factor)
        return np.asarray(np.add.reduceat(rows, columns, axis=1), dtype=np.float64)


def _block_counts(image: FloatArray, factor: int) -> FloatArray:
    return _block_sums(np.ones((*image.shape[:2], 1)), factor)


def _beside(candidate: FloatArray, reference: FloatArray, kept: Coded) -> dict[str, Coded]:
    """The candidate and the residual of the difference, given the stored reference."""
    base = kept.decoded()
    with np.errstate(invalid="ignore", over="ignore"):
        difference = candidate - reference
        near = np.abs(difference) < NEAR * np.abs(reference)
        moved = coded(np.where(near, base + difference, candidate), kept.exponent)
        rest = difference - (moved.decoded() - base)
    rest = np.where(np.isfinite(rest), rest, 0.0)
    return {"candidate": moved, "rest": coded(rest, _exponent(rest), REST_BITS)}


def _exponent(*pictures: FloatArray) -> int:
    """The power of two that brings nearly all values into the range of half floats."""
    values = np.concatenate([np.abs(picture).ravel() for picture in pictures])
    values = values[np.isfinite(values) & (values > 0.0)]
    if not values.size:
        return 0
    top = math.frexp(float(np.percentile(values, 99.9, method="lower")))[1]
    # 2^exponent and 65504 times it must be float64 numbers; subnormal ones will do.
    return int(np.clip(top + HEADROOM - _LARGEST_HALF, -1070, 1008))


def _zigzag(codes: Codes) -> Codes:
    """0, -1, 1, -2, ... (as 16-bit two's complement) -> 0, 1, 2, 3, ...: small ones have an empty
    high byte, whatever their sign."""
    return np.asarray((codes << 1) ^ -(codes >> 15), dtype=np.uint16)


def _unzigzag(codes: Codes) -> Codes:
    return np.asarray((codes >> 1) ^ -(codes & 1), dtype=np.uint16)


def _deflated(streams: list[Codes]) -> str:
    planes = [bytes_ for s in streams for bytes_ in ((s >> 8), (s & 0xFF))]
    # Level 9 takes four times as long and saves 2 % of noise.
    compressor = zlib.compressobj(6, zlib.DEFLATED, -zlib.MAX_WBITS)
    raw = b"".join(plane.astype(np.uint8).tobytes() for plane in planes)
    return base64.b64encode(compressor.compress(raw) + compressor.flush()).decode("ascii")


def _inflated(raw: bytes, data: dict[str, Any]) -> list[Codes]:
    """The codes of each stream, flat."""
    streams, at = [], 0
    for name in ("reference", "candidate", "rest", "error"):
        if name in data:
            count = 3 * data[name]["width"] * data[name]["height"]
            high, low = np.frombuffer(raw, np.uint8, 2 * count, at).reshape(2, count)
            streams.append(high.astype(np.uint16) * np.uint16(256) + low)
            at += 2 * count
    return streams


def _coded(described: dict[str, Any], codes: Codes) -> Coded:
    shape = described["height"], described["width"], 3
    return Coded(codes.reshape(shape), described["exponent"], dict(described["beyond"]))
