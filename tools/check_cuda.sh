#!/bin/sh
# Checks Mitsuba's variant cuda_ad_rgb against scalar and llvm on a machine with an NVIDIA GPU: what
# needs a GPU in the tests, the command `variants`, and one scene against our float64 renderer. It
# takes less than five minutes where kernels are compiled (`reference-rt warm-up`), and prints the
# device, the driver and the versions for the table in docs/back_ends.md.
#
#     tools/check_cuda.sh [FOLDER]        # results and pages go there; by default out/cuda
#
# Exit code: 0 if all agree, 1 if something differs, 4 where there is no GPU.
set -u
cd "$(dirname "$0")/.."
out=${1:-out/cuda}
command -v nvidia-smi > /dev/null || { echo "no GPU: nvidia-smi is not there"; exit 4; }
nvidia-smi --query-gpu=name,driver_version --format=csv,noheader
python -c 'import importlib.metadata as m; print("Mitsuba", m.version("mitsuba"), "Dr.Jit", m.version("drjit"))'
code=0
pytest -q -n 0 -m "" tests/comparisons/experiments/test_variants.py -k cuda || code=1
reference-rt variants --variant scalar_rgb --variant llvm_ad_rgb --variant cuda_ad_rgb \
  cornell_box spheres_whitted material_principled environment --rays 200000 -o "$out/variants" || code=1
reference-rt compare scenes/cornell_box.yaml --variant cuda_ad_rgb --size 64x64 --time-limit 60s \
  --fresh -o "$out/compare" || code=1
echo "pages: $out/variants/report.html, $out/compare/report.html"
exit $code
