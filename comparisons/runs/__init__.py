"""Services of a run: worker processes, provenance, the code fingerprint, the thread-pool cooldown.

- `engine`: what all experiments share: keys, stored results, what is left measured by processes.
- `processes`: worker processes that may crash or hang without ending the run.
- `provenance`: versions, machine and date, which a reader needs to repeat a run; the code
  fingerprint, part of the cache key of every stored result.
- `elsewhere`: waits until idle threads stop spinning, before a time is measured.

Times are wall-clock seconds.  To add one: a module without knowledge of what the run compares.
"""
