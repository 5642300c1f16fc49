"""Rays that both renderers trace, and the error bounds that their hits must keep."""
