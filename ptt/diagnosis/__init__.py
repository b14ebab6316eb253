"""Which physics is missing: noise and unknown at the ground, then evidence, the search, and what is told of it."""
