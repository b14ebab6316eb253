"""Which physics is missing: `diagnose` goes through noise and unknown, evidence, the search, and what is told of it."""
