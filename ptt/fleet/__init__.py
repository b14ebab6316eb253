"""Many machines over many months: a store of their runs and results, and alarms on what changes."""
