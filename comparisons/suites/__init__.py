"""Suites: all scenes of a folder, each with a budget, compared in processes of their own."""
