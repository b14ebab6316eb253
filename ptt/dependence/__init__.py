"""What an error depends on: trial functions of context variables, and permutation tests of them."""
