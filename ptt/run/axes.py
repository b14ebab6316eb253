"""The axes of a tool position, by the names that figures of an error have."""

AXES = ("x", "y", "z")
AXES_TOTAL = (*AXES, "total")  # total: the root of the sum of their squares
