"""Backlash: measured from a linear-scale log, and the directions of travel by which commands allow for it."""
