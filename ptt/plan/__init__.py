"""Which poses to measure: first, and next where two effects cannot be told apart."""
