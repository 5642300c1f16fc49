"""Work in child processes: a crash of a native library ends only the process that it is in.

`child` is the parent's side: it sends requests, enforces time limits, replaces children that die
and reports why.  `pool` has requests carried out by children of this process, or of the workers of
a cluster.  `protocol` is the worker's side: JSON lines on standard input and output.  A worker is a
module that calls `private_stdout` once and `carry_out` for each request.
"""
