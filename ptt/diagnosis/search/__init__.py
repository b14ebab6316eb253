"""The search for the likeliest set: moves, laws that bend, plain ways to say the same, and the rest that is left."""
