"""The version of the installed package; reading its metadata takes milliseconds."""

from importlib.metadata import version

__version__ = version("reference-rt")
