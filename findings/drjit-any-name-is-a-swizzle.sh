#!/usr/bin/env bash
# Dr.Jit 1.5.0 (with Mitsuba 3.9.1): a vector has an attribute of any name whose last letter is a component. Letters
# that are none count as the first component. So `v.max` is (x, x, x) where dr.max(v) was meant, and code that asks
# hasattr(value, "matrix") to tell a transform from a vector finds every vector to be one. Names that end in another
# letter raise AttributeError, as they should. Seen on 2026-11-29.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install -q --disable-pip-version-check mitsuba==3.9.1 drjit==1.5.0 numpy==2.4.6
cat > names.py <<'END'
import mitsuba as mi

mi.set_variant("scalar_rgb")
v = mi.ScalarVector3f(1, 2, 3)
for name in ("zyx", "max", "may", "matrix", "mean"):
    try:
        print(name, [float(x) for x in getattr(v, name)])
    except AttributeError:
        print(name, "AttributeError")
END
venv/bin/python names.py | tee seen
diff seen - <<'END'
zyx [3.0, 2.0, 1.0]
max [1.0, 1.0, 1.0]
may [1.0, 1.0, 2.0]
matrix [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
mean AttributeError
END
