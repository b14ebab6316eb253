"""`ptt` and `python -m ptt`: the command line, which Ctrl-C may end at any moment, while it is being loaded as well."""

import sys


def main() -> None:
    """Load the command line and run it."""
    try:
        from ptt.commands.main import main as command_line

        command_line()
    except KeyboardInterrupt:
        sys.stderr.write("error: interrupted\n")
        sys.exit(130)


if __name__ == "__main__":
    main()
