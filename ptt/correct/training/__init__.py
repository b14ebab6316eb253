"""Training: physics first, then a network for the rest, both judged on held-out rows."""
