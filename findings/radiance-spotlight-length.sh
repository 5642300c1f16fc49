#!/usr/bin/env bash
# The direction of Radiance's `spotlight` is no direction alone: its length is how far behind the lamp the point lies from which the
# light spreads. On the axis at the distance t a direction of length f gives (t / (t + f))^2 of the light of the same ball as a
# `light`: 0.69 of it at 5 by a unit vector, 0.25 by one of length 5. (Radiance 6.0a, pyradiance 1.3.1.) Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3.11 -m venv venv
venv/bin/pip install -q --disable-pip-version-check pyradiance==1.3.1 numpy
cat > spot.py <<'END'
import subprocess
import sys
from pathlib import Path

import pyradiance

programs = Path(pyradiance.__file__).parent / "bin"


def lit(material):
    """A matte floor's radiance, 5 below a ball of this material."""
    Path("s.rad").write_text(
        f"void {material}\nlamp sphere ball 0 0 4 0 0 5 0.001\n"
        "void plastic matte 0 0 5 0.5 0.5 0.5 0 0\n"
        "matte polygon floor 0 0 12 -9 -9 0 9 -9 0 9 9 0 -9 9 0\n"
    )
    Path("s.oct").write_bytes(subprocess.run([programs / "oconv", "s.rad"], check=True, capture_output=True).stdout)
    ray = "0.001 0 1 0 0 -1\n"
    found = subprocess.run([programs / "rtrace", "-h", "-ab", "0", "-dt", "0", "s.oct"], input=ray.encode(), check=True, capture_output=True)
    return float(found.stdout.split()[0])


whole, good = lit("light lamp 0 0 3 1e6 1e6 1e6"), True
for length in (0.001, 1.0, 5.0):
    share = lit(f"spotlight lamp 0 0 7 1e6 1e6 1e6 60 0 0 {-length}") / whole
    expected = (5.0 / (5.0 + length)) ** 2
    print(f"a direction of length {length}: {share:.4f} of a light's; (t / (t + f))^2 is {expected:.4f}")
    good &= abs(share / expected - 1.0) < 0.003
sys.exit(0 if good else 1)
END
venv/bin/python spot.py
