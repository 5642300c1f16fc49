"""Packet traversal (Wald et al. 2001): PACKET_SIZE coherent rays traverse the BVH together.

`packet.py` makes a packet of neighbouring rays and decides whether they are coherent; `nodes.py`
tests it against boxes; `traversal.py` traverses.  Only `array_query.py` uses them, for closest hits
of large arrays of rays in scenes with a BVH and without instances.

A box is tested once for all rays, with intervals in place of origins and inverse directions.
Intervals can only enlarge the set of boxes that a ray would enter, and leaves test ray by ray: each
hit is the one of `geometry.closest_hit`, to the last bit.
"""
