"""The functions behind `import ptt` and the command line: both have the same checks and results."""
