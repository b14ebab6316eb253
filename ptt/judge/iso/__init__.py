"""ISO 230-2 and ISO 9283 figures."""
