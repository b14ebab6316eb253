"""The HTML report on a fleet of machines."""
