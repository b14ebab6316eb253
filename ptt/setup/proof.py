"""What proves a mistake in the set-up: how far an error has to fall once it is undone, and to where."""

FALL = 5.0  # times less error by one mistake that is undone: a fault of the machine beside it leaves a fifth at least
STEEP = 20.0  # by several, or by one that much else could be: what stays then is noise and play alone
BEYOND_FAULTS = 2.0  # mm, twice the largest ordinary fault: a machine that is understood errs by less
