"""Runs with a sealed hidden effect, and the score."""
