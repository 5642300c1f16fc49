#!/usr/bin/env bash
# OpenCV 5.0.0 (opencv-contrib-python-headless): its measures of pictures take 255 for white, whatever the type. Of pictures of
# floats, where white is 1:
# - SSIM of two pictures of noise that have nothing in common is 0.996; the same ones times 255 have -0.02. Of black and white it is
#   C1 / (1 + C1) = 0.867 with C1 = (0.01 * 255)^2, where Wang et al. (2004) have L, the range of the values, in place of
#   255, which is 0.0001. QualitySSIM has no parameter for it.
# - PSNR of black and white is 48.1 dB, 20 log10(255), where it is 0 dB by definition; of 16 bits it is -48.2 dB. (cv2.PSNR has R.)
# - GMSD is 0.0001 where it is 0.2 in the unit of bytes.
# The largest difference, cv2.norm with NORM_INF, from a picture in which no value is a number is 0. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check opencv-contrib-python-headless==5.0.0.93 numpy==2.4.6
venv/bin/python - <<'END_OF_PYTHON'
import math

import cv2
import numpy as np

random = np.random.default_rng(1)
one, other = (random.random((64, 64), dtype=np.float32) for _ in range(2))
black, white = np.zeros_like(one), np.ones_like(one)


def ssim(a, b):
    return cv2.quality.QualitySSIM_compute(a, b)[0][0]


def gmsd(a, b):
    return cv2.quality.QualityGMSD_compute(a, b)[0][0]


print("SSIM of noise:", ssim(one, other), "times 255:", ssim(255 * one, 255 * other))
assert ssim(one, other) > 0.99 and abs(ssim(255 * one, 255 * other)) < 0.1
stabiliser = (0.01 * 255) ** 2
print("SSIM of black and white:", ssim(black, white), "C1 / (1 + C1):", stabiliser / (1 + stabiliser))
assert abs(ssim(black, white) - stabiliser / (1 + stabiliser)) < 1e-6
wide = cv2.PSNR((65535 * black).astype(np.uint16), (65535 * white).astype(np.uint16))
print("PSNR of black and white:", cv2.PSNR(black, white), "of 16 bits:", wide, "with R=1:", cv2.PSNR(black, white, 1.0))
assert abs(cv2.PSNR(black, white) - 20 * math.log10(255)) < 1e-6
assert abs(wide - 20 * math.log10(255 / 65535)) < 1e-6
assert abs(cv2.PSNR(black, white, 1.0)) < 1e-6
print("GMSD of noise:", gmsd(one, other), "times 255:", gmsd(255 * one, 255 * other))
assert gmsd(one, other) < 0.001 < 0.1 < gmsd(255 * one, 255 * other)
spoilt = np.full_like(one, np.nan)
print("the largest difference from no number:", cv2.norm(one, spoilt, cv2.NORM_INF))
assert cv2.norm(one, spoilt, cv2.NORM_INF) == 0.0
END_OF_PYTHON
