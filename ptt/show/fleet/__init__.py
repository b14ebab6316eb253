"""A page about many machines."""
