"""Packet traversal: coherent rays go through the hierarchy together."""
