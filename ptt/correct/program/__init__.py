"""G-code programs: read, corrected and cut, written again with everything else as it was."""
