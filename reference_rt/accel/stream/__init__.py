"""Stream traversal: all rays of a block go through the hierarchy in turns."""
