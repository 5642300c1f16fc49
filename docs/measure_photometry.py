"""Holds lamps of files of photometry against Radiance: `python docs/measure_photometry.py FOLDER`,
the folder of Radiance's programs, such as pyradiance/bin.

Files of each symmetry, with random candelas, are read by `ies2rad` and by us, and light 2,000
points at distance 10.  Printed is how far Radiance's irradiance is from ours at most, over ours;
and of files with a third factor, and of half a sphere, what Radiance makes of them.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import reference_rt as rt

VERTICAL = (0, 30, 60, 90, 120, 150, 180)
HORIZONTAL: dict[str, tuple[int, ...]] = {
    "0": (0,),
    "0 to 90": (0, 30, 90),
    "0 to 180": (0, 30, 90, 150, 180),
    "0 to 360": (0, 60, 120, 200, 270, 330, 360),
    "90 to 270": (90, 150, 180, 210, 270),
}
WATT = 179.0
"""Lumens of a watt, by which Radiance divides candelas."""


def photometry(
    horizontal: tuple[int, ...],
    heading: str = "IESNA:LM-63-2002",
    other: float = 1,
    vertical: tuple[int, ...] = VERTICAL,
) -> str:
    """A file with random candelas;  other: the second number of the ballast's line."""
    rows = np.random.default_rng(1).integers(100, 900, (len(horizontal), len(vertical)))
    rows[:, 0], rows[:, -1] = 500, 300
    if horizontal[-1] == 360:
        rows[-1] = rows[0]
    numbers = f"1 -1 1 {len(vertical)} {len(horizontal)} 1 2 0 0 0\n1 {other} 10"
    labels = "[TEST] 1\n[TESTLAB] none\n[ISSUEDATE] 1-JAN-2020\n[MANUFAC] none"
    table = [vertical, horizontal, *rows.tolist()]
    lines = [heading, labels, "TILT=NONE", numbers, *(" ".join(map(str, row)) for row in table)]
    return "\n".join(lines) + "\n"


def by_radiance(text: str, points: Any, programs: Path, place: Path) -> Any:
    """(n,): the irradiance that faces the lamp at points (n, 3), times WATT."""
    (place / "lamp.ies").write_text(text)
    data = f"{programs.parent / 'lib'}:{place}"
    around = {"cwd": place, "env": {**os.environ, "RAYPATH": data}, "check": True}
    call = [programs / "ies2rad", "-o", "lamp", "lamp.ies"]
    subprocess.run(call, **around, capture_output=True)
    scene = subprocess.run([programs / "oconv", "lamp.rad"], **around, capture_output=True)
    (place / "lamp.oct").write_bytes(scene.stdout)
    rays = "".join(
        "{:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}\n".format(*p, *-p) for p in points
    )
    options = ["-h", "-I", "-ab", "0", "-dt", "0", "-dc", "1", "-ds", "0", "lamp.oct"]
    found = subprocess.run(
        [programs / "rtrace", *options], **around, capture_output=True, input=rays.encode()
    )
    return WATT * np.array([line.split()[1] for line in found.stdout.split(b"\n") if line], float)


def by_us(text: str, points: Any, place: Path) -> Any:
    """The same.  Radiance's lamps hang with their nadir towards -z, and C = 0 towards +x."""
    (place / "lamp.ies").write_text(text)
    light = {"type": "goniometric", "origin": [0, 0, 0], "target": [0, 0, -1], "file": "lamp.ies"}
    scene = rt.Scene.parse(str({"lights": [light]}), folder=place)
    return scene.sample_lights(points, np.full((len(points), 3), 0.5)).radiance[:, 0]


def main() -> None:
    programs, rng = Path(sys.argv[1]), np.random.default_rng(2)
    points = rng.normal(size=(2000, 3))
    points *= 10.0 / np.linalg.norm(points, axis=1)[:, None]
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for name, horizontal in HORIZONTAL.items():
            text = photometry(horizontal)
            theirs, ours = by_radiance(text, points, programs, place), by_us(text, points, place)
            print(f"horizontal angles {name}: {np.abs(theirs / ours - 1.0).max():.1e}")
            if name == "90 to 270":
                turned = by_us(text, points * [1.0, -1.0, 1.0], place)
                print(f"  mirrored in y: {np.abs(theirs / turned - 1.0).max():.1e}")
        for heading in ("IESNA91", "IESNA:LM-63-1995", "IES:LM-63-2019"):
            text = photometry((0,), heading, 1.1)
            theirs, ours = by_radiance(text, points, programs, place), by_us(text, points, place)
            print(f"{heading}, third factor 1.1: Radiance over ours {(theirs / ours).mean():.4f}")
        half = photometry((0,), vertical=(0, 30, 60, 90))
        theirs, ours = by_radiance(half, points, programs, place), by_us(half, points, place)
        behind = points[:, 2] > 0.0
        print(f"beyond a table that ends at 90 degrees with 3: {theirs[behind].max():.3f} at most")
        print(f"  by us {ours[behind].max():.3f}")


if __name__ == "__main__":
    main()
