"""Stream traversal: a block of up to BLOCK rays traverses the BVH, each ray one step per round.

A single ray spends its time waiting: for the boxes that decide which node is next, for that node's
memory, for mispredicted branches.  Here every ray of the block makes one step before any makes the
next.  Steps overlap, memory is prefetched, and each ray is pushed to one of three queues (inner
node, leaf, pop), which replaces the unpredictable branch.  Each hit is the one of
`geometry.closest_hit`, to the last bit.

`state.py` holds the rays' state, `traversal.py` the steps.  `block_query.py` calls them, for scenes
with a BVH and without instances.
"""
