"""Tests of the Python package, and what they share."""
