"""Which physics is missing: screen, path, ties, rest, verdict."""
