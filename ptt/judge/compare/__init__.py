"""A run held against a model: how far off, where, and how surely."""
