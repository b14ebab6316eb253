"""Many machines, many months: a store of runs, what became of each, and who is going bad."""
