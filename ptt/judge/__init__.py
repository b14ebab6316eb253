"""How good a model or a machine is: comparison, error reduction, the ladder of steps, its history, ISO figures."""
