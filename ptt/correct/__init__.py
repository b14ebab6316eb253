"""Commands for the machine: the exact inverse row by row, and what becomes of a row that cannot be sent."""
