"""Behind the front door: what a library user calls and a verb of the command line prints, with the same guards."""
