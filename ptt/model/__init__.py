"""A model: the nominal mechanism plus effects, their causal chain, and which of them belong to one run alone."""
