#!/usr/bin/env bash
# Mitsuba 3.9.1, plugins written in Python: `Properties.objects()` has no constant colours. A plugin that takes nested
# textures by it works with images, checkerboards and `uniform`, and fails ("unreferenced property") as soon as one of
# them is `rgb`, which the parser keeps as three numbers; `Properties.items()` has them, and `get_texture(name)` makes
# the texture. Seen on 2026-11-28.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 numpy==2.4.6
venv/bin/python - <<'END'
import mitsuba as mi

mi.set_variant("scalar_rgb")
seen = {}


class Product(mi.Texture):
    def __init__(self, properties):
        super().__init__(properties)
        if self.by_name:
            seen["items"] = [name for name, _ in properties.items()]
            self.of = [properties.get_texture(name) for name in seen["items"]]
        else:
            seen["objects"] = [name for name, _ in properties.objects()]


mi.register_texture("product", Product)
PARTS = {
    "checks": {"type": "checkerboard"},
    "grey": {"type": "uniform", "value": 0.5},
    "red": {"type": "rgb", "value": [0.5, 0.1, 0.1]},
}
Product.by_name = False
try:
    mi.load_dict({"type": "product", **PARTS})
    message = ""
except RuntimeError as error:
    message = str(error)
assert "unreferenced property" in message and '"red"' in message
Product.by_name = True
assert len(mi.load_dict({"type": "product", **PARTS}).of) == 3
print(seen, message)
assert seen == {"objects": ["checks", "grey"], "items": ["checks", "grey", "red"]}
END
