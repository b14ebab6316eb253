"""Find out why a 3-PTT parallel robot misses its target, name the missing physics, and correct it."""

__version__ = "0.1.0"
