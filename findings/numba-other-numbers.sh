#!/usr/bin/env bash
# Numba 0.68.1 against Python 3.11 and NumPy 2.4.6, on the same text, without fastmath:
# - numpy.remainder (and numpy.mod) of a zero and a negative divisor: NumPy's zero has the divisor's sign, Numba's not;
#   1 / x then is minus or plus infinity. Python's own % on floats agrees in both.
# - numpy.sign(-0.0): 0.0 by NumPy, -0.0 by Numba.
# - numpy.minimum and maximum of 0.0 and -0.0: the second by NumPy, the first by Numba.
# - round(2.675, 2): 2.67 by Python, which rounds the exact binary value, 2.68 by Numba.
# - numpy.round(1e308, 2): infinity by NumPy, 1e308 by Numba.
# All other pairs of 14 extreme values agree in 15 functions tried, not a number and infinities included.
# Seen on 2026-11-28.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check numba==0.68.1 numpy==2.4.6
venv/bin/python -W ignore - <<'END'
import numba
import numpy as np

CASES = {
    "remainder(0.0, -1.0)": (lambda: np.remainder(np.float64(0.0), np.float64(-1.0)), "-0.0", "0.0"),
    "0.0 % -1.0": (lambda a=0.0, b=-1.0: a % b, "-0.0", "-0.0"),
    "sign(-0.0)": (lambda: np.sign(np.float64(-0.0)), "0.0", "-0.0"),
    "minimum(0.0, -0.0)": (lambda: np.minimum(np.float64(0.0), np.float64(-0.0)), "-0.0", "0.0"),
    "maximum(-0.0, 0.0)": (lambda: np.maximum(np.float64(-0.0), np.float64(0.0)), "0.0", "-0.0"),
    "round(2.675, 2)": (lambda: round(2.675, 2), "2.67", "2.68"),
    "round(1e308, 2)": (lambda: np.round(np.float64(1e308), 2), "inf", "1e+308"),
}
for name, (function, python, compiled) in CASES.items():
    got = str(float(function())), str(float(numba.njit(function)()))
    print(f"{name}: {got[0]} without Numba, {got[1]} with it")
    assert got == (python, compiled)
END
