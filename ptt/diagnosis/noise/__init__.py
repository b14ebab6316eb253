"""Noise of a run: its scatter, what it remembers from row to row and from visit to visit, and gross errors."""
