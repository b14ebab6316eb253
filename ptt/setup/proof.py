"""Limits for proof of a set-up mistake: by which ratio an error has to fall once it is undone, and to which level."""

FALL = 5.0  # ratio for one mistake: faults of the machine, which remain, are a fifth of its error at most
STEEP = 20.0  # ratio for several mistakes, or for one that is easily confused: only noise and backlash may remain
BEYOND_FAULTS = 2.0  # mm, twice the largest ordinary fault: the error of a correctly set-up machine is smaller
