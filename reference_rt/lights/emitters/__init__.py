"""The types of lights, one to a file."""
