"""raysect (PyPI, float64): a second tracer of solids, which shares nothing with ours.

`translate` says what a shape is there, from descriptions; `worker` traces, in a process of its own,
which alone imports raysect.
"""
