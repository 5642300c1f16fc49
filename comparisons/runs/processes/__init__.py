"""Work in processes of their own: a fault of a native library ends only the one it is in.

`pool` is the side that asks, `protocol` the side that answers.
"""
