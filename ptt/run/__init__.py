"""One run: table and readers, travel, when two poses are one, noise, held-out blocks, and what a model sees of it."""
