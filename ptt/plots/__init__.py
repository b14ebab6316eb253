"""Pictures, static PNG."""
