"""`python render_xml.py VARIANT FOLDER REPLICATES SPP NAME...`: renders FOLDER/NAME.xml by whatever
Mitsuba the interpreter has, to FOLDER/NAME.npy (replicates, height, width, 3), and says in
FOLDER/told.jsonl what it begins, and how it ended.  It is run in other environments, which have
Mitsuba and NumPy alone, so it imports nothing else.
"""

import json
import signal
import sys
from pathlib import Path

import drjit
import mitsuba as mi
import numpy as np

SECONDS = 300
"""Time limit of a scene, beyond which the system ends the process, where it has alarms."""


def main(variant: str, folder: Path, replicates: int, spp: int, names: list[str]) -> None:
    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)
    # With one thread Mitsuba waits for ever for the one that decodes an .exr file.
    drjit.set_thread_count(max(drjit.thread_count(), 2))

    def tell(name: str, problem: str) -> None:
        with (folder / "told.jsonl").open("a", encoding="utf-8") as file:
            print(json.dumps([name, problem]), file=file)

    for name in names:
        tell(name, f"it crashed, or took longer than {SECONDS} s")
        if hasattr(signal, "alarm"):
            signal.alarm(SECONDS)
        try:
            scene = mi.load_file(str(folder / f"{name}.xml"))
            pictures = [np.array(mi.render(scene, spp=spp, seed=k)) for k in range(replicates)]
            np.save(folder / f"{name}.npy", np.stack(pictures)[..., :3].astype(np.float64))
        except (RuntimeError, ValueError, TypeError) as error:
            tell(name, " ".join(str(error).split())[-300:] or type(error).__name__)
        else:
            tell(name, "")


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]), sys.argv[5:])
