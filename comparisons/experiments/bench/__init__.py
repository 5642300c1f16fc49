"""`reference-rt bench`: the renderer's speed, each number with the one that it is compared with.

A row (`row.Row`) is one number of ours, a peer's, their ratio and the goal of that ratio: medians
and quartiles of rounds in which both take turns (`row.alternate`).  Rows that are measured
together are a group; `run` measures the groups that are not stored yet, and shows them.  Each scene
of the suite `smoke`, and of `scenes.STRANGERS`, is a group of its own.

To add a row, write a function `measure(setting) -> list[Row]` in a file of its own and list it in
`run.GROUPS`.
"""
