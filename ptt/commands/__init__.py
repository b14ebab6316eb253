"""The verbs of the command line: arguments in, a frozen result out as text or JSON."""
