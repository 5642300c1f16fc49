#!/usr/bin/env bash
# flip-evaluator 1.7:
# - FLIP of high dynamic range is 2.5 times as large here if the two pictures are exchanged, since the exposures are taken
#   from the first, the reference; FLIP of display pictures does not change at all. A limit holds for one order only.
# - Pictures of bytes are taken without a word, as if they were floats, of which all above 1 are white: two that
#   differ give 0.0, where the same ones as floats give 0.026.
# - One pixel that is not a number gives a mean of 0.001: a threshold passes it.
# Seen on 2026-11-28.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check flip-evaluator==1.7 numpy==2.4.6
venv/bin/python - <<'END'
import flip_evaluator
import numpy as np


def mean(reference, test, kind):
    return flip_evaluator.evaluate(reference, test, kind)[1]


random = np.random.default_rng(1)
one = 4.0 * random.random((64, 64, 3), dtype=np.float32)
fireflies = np.where(random.random((64, 64, 1)) < 0.1, 20.0, 1.1).astype(np.float32)
there, back = mean(one, one * fireflies, "HDR"), mean(one * fireflies, one, "HDR")
print("HDR:", there, "exchanged:", back, "ratio", back / there)
assert 2.3 < back / there < 2.6

shown = random.random((64, 64, 3), dtype=np.float32)
darker = shown.copy()
darker[10:20, 10:20] *= 0.5
floats = mean(shown, darker, "LDR")
assert floats == mean(darker, shown, "LDR")
as_bytes = mean((255 * shown).astype(np.uint8), (255 * darker).astype(np.uint8), "LDR")
print("display picture of floats:", floats, "of bytes:", as_bytes)
assert as_bytes < 0.1 * floats

spoilt = shown.copy()
spoilt[3, 3] = np.nan
print("with one pixel not a number:", mean(shown, spoilt, "LDR"))
assert 0.0 < mean(shown, spoilt, "LDR") < 0.002
END
