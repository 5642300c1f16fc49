"""F14: the same bits for any number of threads and any order of work."""
