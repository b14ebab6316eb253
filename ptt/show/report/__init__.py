"""A report on one run and one model: gathered once, written as one HTML file that needs nothing else."""
