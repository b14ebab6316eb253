"""What is told of an explanation: its steps, how sure they are, what the rest depends on, the verdict."""
