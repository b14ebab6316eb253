"""Design of experiments: poses of a first run, and poses that discriminate between effects."""
