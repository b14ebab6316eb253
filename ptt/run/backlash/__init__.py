"""Backlash: measured from a linear-scale log, and compensated on reversal."""
