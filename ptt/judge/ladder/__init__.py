"""The ladder: the error after each effect that was added."""
