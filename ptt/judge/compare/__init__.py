"""A run compared with a model: size and place of the error, and tests of it."""
