"""Static pictures with matplotlib, written as PNG."""
