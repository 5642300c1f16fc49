"""Suites: all scenes of a folder, each with a budget, compared in worker processes.

A suite is a YAML file (`suite`): defaults and budgets by scene name (`comparisons.compare.budget`).
`suite` makes the list of cases too; `run` executes them, each by a `worker` process, and stores
every finished case with a `keys.case_key`: it is not run again until its scene, budget, sources or
versions change.  `run` reads an output folder again, too, and shows progress on stderr.

`results.json` is whole after each case.  A scene without a budget of its own gets the defaults, so
that a new scene is in every suite.  An invalid scene or a crashed worker is a case with that
verdict and does not stop the others.

To add a suite, write a YAML file; list it in `suite.BUILT_IN` to make it available by name.
"""


def worker_command(threads: int | None = None, runner: str | None = None) -> list[str]:
    """The module that runs cases in a process of its own, and its options, see `worker`;  threads:
    None for all cores."""
    of_threads = [] if threads is None else ["--threads", str(threads)]
    of_runner = [] if runner is None else ["--runner", runner]
    return ["comparisons.suites.worker", *of_threads, *of_runner]
