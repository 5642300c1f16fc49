"""Scenes: their description, how files are read, and how kernels' tables are built of them."""
