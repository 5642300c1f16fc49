"""Float pictures inside the page; decoded by `unpack.js` and `unpack`.

A picture is stored as float32 numbers rounded to a number of bits; values beyond their range are
listed separately.  The candidate's codes are stored as differences from the reference's, which are
small.  Rounded numbers cannot distinguish 1.0001 from 1: therefore the difference of the pictures
is stored too, as the residual beyond the difference of the stored pictures.

Precision after decoding, relative: radiance 1/1024, the difference 1/64, the standard error 1/16,
in about 12 bytes a pixel; `EXACT` pictures are what an EXR file holds, in about twice as many.
NaN, infinities and zeros are exact.
"""

import base64
import json
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from comparisons.results.case import FloatArray, Images


class Bits(NamedTuple):
    """Significant bits, including the leading one; fewer bits compress better.  digits: decimal
    ones of radiance that they stand for."""

    radiance: int
    rest: int
    error: int
    digits: int


COARSE = Bits(radiance=11, rest=6, error=4, digits=3)
EXACT = Bits(radiance=24, rest=24, error=11, digits=7)

NEAR = 1.0 / 64.0
"""Candidate values within this relative difference are stored as the stored reference plus the
difference: equal pixels then have equal codes, and the residual is the difference itself."""

Codes = npt.NDArray[np.uint32]


@dataclass(frozen=True)
class Coded:
    """A picture as float32 numbers without their last `shift` bits, which are zero, or as listed in
    `beyond` under its index in the flattened picture."""

    codes: Codes
    """(height, width, 3)"""
    shift: int
    beyond: dict[int, float]

    def decoded(self) -> FloatArray:
        values = (self.codes << np.uint32(self.shift)).view(np.float32).astype(np.float64)
        values.flat[list(self.beyond)] = list(self.beyond.values())
        return values

    def described(self) -> dict[str, Any]:
        height, width, _ = self.codes.shape
        listed = [[index, value] for index, value in self.beyond.items()]
        return {"width": width, "height": height, "shift": self.shift, "beyond": listed}


@dataclass(frozen=True)
class Unpacked:
    """A case's pictures as the page decodes them."""

    candidate: FloatArray
    reference: FloatArray
    difference: FloatArray | None
    error: FloatArray | None
    others: tuple[FloatArray, ...] = ()


def pack(images: Images, factor: int = 1, bits: Bits = COARSE) -> dict[str, Any]:
    """`images` as JSON: sizes, shifts and "bytes", base64 of a raw deflate stream (RFC 1951).

    With a factor above 1 the pixels are means over factor x factor of the given ones.  The stream
    holds the codes of the reference, the candidate, the rest of the difference and the standard
    error (the last two where there are any), and of other renderers' pictures: of each first all
    the highest bytes, last all the lowest ones, in the order rows, columns, channels.
    """
    images = reduced_images(images, factor)
    candidate, reference = images.candidate, images.reference
    kept = {"reference": coded(reference, bits.radiance)}
    streams = [kept["reference"].codes]
    if candidate.shape == reference.shape:
        kept |= _beside(candidate, kept["reference"], reference, bits)
        streams.append(_zigzag(kept["candidate"].codes - kept["reference"].codes))
        streams.append(kept["rest"].codes)
        if images.error is not None:
            kept["error"] = coded(images.error, bits.error)
            streams.append(kept["error"].codes)
    else:
        kept["candidate"] = coded(candidate, bits.radiance)
        streams.append(kept["candidate"].codes)
    described: dict[str, Any] = {name: picture.described() for name, picture in kept.items()}
    others = [coded(picture, bits.radiance) for picture in images.others.values()]
    streams += [picture.codes for picture in others]
    described["others"] = [picture.described() for picture in others]
    return {"factor": factor, "digits": bits.digits, **described, "bytes": _deflated(streams)}


def unpack(data: dict[str, Any]) -> Unpacked:
    """Decode `pack`'s JSON: the same numbers as in the browser, bit for bit."""
    raw = zlib.decompress(base64.b64decode(data["bytes"]), -zlib.MAX_WBITS)
    streams = iter(_inflated(raw, data))
    reference_codes, candidate_codes = next(streams), next(streams)
    reference = _coded(data["reference"], reference_codes).decoded()
    if "rest" not in data:
        candidate = _coded(data["candidate"], candidate_codes).decoded()
        return Unpacked(candidate, reference, None, None, _others(data, streams))
    candidate_codes = reference_codes + _unzigzag(candidate_codes)
    candidate = _coded(data["candidate"], candidate_codes).decoded()
    rest = _coded(data["rest"], next(streams)).decoded()
    with np.errstate(invalid="ignore", over="ignore"):
        difference = candidate - reference + rest
    error = _coded(data["error"], next(streams)).decoded() if "error" in data else None
    return Unpacked(candidate, reference, difference, error, _others(data, streams))


def _others(data: dict[str, Any], streams: Iterator[Codes]) -> tuple[FloatArray, ...]:
    return tuple(_coded(one, next(streams)).decoded() for one in data["others"])


def as_json(data: dict[str, Any]) -> str:
    """Strict JSON that cannot end the script element around it."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def coded(values: FloatArray, bits: int) -> Coded:
    """`values` (height, width, 3) rounded to `bits` significant bits, at most 24."""
    significand, powers = np.frexp(values)
    with np.errstate(over="ignore", under="ignore"):
        exact = np.ldexp(np.rint(np.ldexp(significand, bits)), powers - bits)
        rounded = exact.astype(np.float32)
    lost = np.isfinite(values) & (rounded != exact)  # beyond float32's range
    rounded[lost] = 0.0
    listed = {i: float(values.flat[i]) for i in np.flatnonzero(lost).tolist()}
    shift = 24 - bits
    return Coded(rounded.view(np.uint32) >> np.uint32(shift), shift, listed)


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
    others = {whose: reduced(picture, factor) for whose, picture in images.others.items()}
    pair = reduced(images.candidate, factor), reduced(images.reference, factor)
    return Images(*pair, error, others)


def _block_sums(image: FloatArray, factor: int) -> FloatArray:
    with np.errstate(invalid="ignore", over="ignore"):
        rows = np.add.reduceat(image, np.arange(0, image.shape[0], factor), axis=0)
        columns = np.arange(0, image.shape[1], factor)
        return np.asarray(np.add.reduceat(rows, columns, axis=1), dtype=np.float64)


def _block_counts(image: FloatArray, factor: int) -> FloatArray:
    return _block_sums(np.ones((*image.shape[:2], 1)), factor)


def _beside(
    candidate: FloatArray, kept: Coded, reference: FloatArray, bits: Bits
) -> dict[str, Coded]:
    """The candidate and the residual of the difference, given the stored reference."""
    base = kept.decoded()
    with np.errstate(invalid="ignore", over="ignore"):
        difference = candidate - reference
        near = np.abs(difference) < NEAR * np.abs(reference)
        moved = coded(np.where(near, base + difference, candidate), bits.radiance)
        rest = difference - (moved.decoded() - base)
    rest = np.where(np.isfinite(rest), rest, 0.0)
    return {"candidate": moved, "rest": coded(rest, bits.rest)}


def _zigzag(codes: Codes) -> Codes:
    """0, -1, 1, -2, ... (as 32-bit two's complement) -> 0, 1, 2, 3, ...: small ones have empty high
    bytes, whatever their sign."""
    return np.asarray((codes << 1) ^ -(codes >> 31), dtype=np.uint32)


def _unzigzag(codes: Codes) -> Codes:
    return np.asarray((codes >> 1) ^ -(codes & 1), dtype=np.uint32)


def _deflated(streams: list[Codes]) -> str:
    # Level 9 takes four times as long and saves 2 % of noise.
    compressor = zlib.compressobj(6, zlib.DEFLATED, -zlib.MAX_WBITS)
    planes = (s.astype(">u4").ravel().view(np.uint8).reshape(-1, 4).T for s in streams)
    raw = b"".join(plane.tobytes() for plane in planes)
    return base64.b64encode(compressor.compress(raw) + compressor.flush()).decode("ascii")


def _inflated(raw: bytes, data: dict[str, Any]) -> list[Codes]:
    """The codes of each stream, flat."""
    streams, at = [], 0
    described = [data[name] for name in ("reference", "candidate", "rest", "error") if name in data]
    for one in [*described, *data["others"]]:
        count = 3 * one["width"] * one["height"]
        planes = np.frombuffer(raw, np.uint8, 4 * count, at).reshape(4, count)
        streams.append(planes.T.copy().view(">u4")[:, 0].astype(np.uint32))
        at += 4 * count
    return streams


def _coded(described: dict[str, Any], codes: Codes) -> Coded:
    shape = described["height"], described["width"], 3
    return Coded(codes.reshape(shape), described["shift"], dict(described["beyond"]))
