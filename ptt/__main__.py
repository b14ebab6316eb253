"""`ptt` and `python -m ptt`: the command line, which Ctrl-C may end at any moment, while it is being loaded as well."""

import atexit
import os
import sys
from contextlib import suppress

INTERRUPTED = 130


def main() -> None:
    """Load the command line and run it."""
    try:
        from ptt.commands.main import main as command_line

        command_line()
    except KeyboardInterrupt:
        sys.stderr.write("error: interrupted\n")
        _end()
    except SystemExit as end:
        if end.code == INTERRUPTED:
            _end()
        raise


def _end() -> None:
    """End with the code of an interruption.

    Where Ctrl-C came while a module was loaded, the interpreter would otherwise end itself by that signal afterwards,
    and whoever waits for the process would read another code.
    """
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):
            stream.flush()
    os._exit(INTERRUPTED)


if __name__ == "__main__":
    main()
