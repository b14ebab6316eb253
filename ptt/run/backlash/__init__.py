"""Backlash measured from a linear-scale log."""
