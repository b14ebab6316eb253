"""Evidence: all that may explain the readings, linearised, and how likely each set of it is."""
