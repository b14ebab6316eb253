"""A machine measured again: what has changed since its model was fitted, and two runs side by side."""
