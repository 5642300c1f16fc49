"""A folder of scenes on a cluster: `python examples/cluster.py FOLDER OUT [tcp://HOST:8786]`.

The address is that of a Dask scheduler whose workers see both folders.  Without one, processes of
this machine work.  Each scene is a task; one that fails does not stop the others.
"""

import sys
from pathlib import Path

from distributed import Client, as_completed

from reference_rt import render


def render_to(path: Path, out: Path) -> str:
    """Render a scene on a worker."""
    picture = render(path, threads=1)
    picture.save(out / f"{path.stem}.exr")
    return repr(picture)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    folder, out = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
    out.mkdir(parents=True, exist_ok=True)
    with Client(*sys.argv[3:], **({} if sys.argv[3:] else {"threads_per_worker": 1})) as client:
        paths = sorted(folder.glob("*.yaml"))
        tasks = {client.submit(render_to, path, out, pure=False): path for path in paths}
        for task in as_completed(tasks):
            print(f"{tasks[task].name}: {task.exception() or task.result()}")
