"""Experiments, one folder each, run by the command of the same name.

`bench` (command `bench`): speed against Mitsuba;  `convergence` (`converge`): error against time;
`methods`: the textbook's intersection methods;  `selftest`: faults planted in the renderer must be
caught;  `stability`: where renderers fail as scenes become extreme.

An experiment stores what it has measured in its output folder with a key of all that it depends on,
and writes `results.json` for machines and a page or a Markdown table for people.  Verdicts of
suites do not depend on these folders.
"""
