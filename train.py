"""Train a compensator from a tracker run: python train.py RUN.csv --machine M.toml --out DIR.

Fits the effects of the machine file, lets the RBF network learn what is left, and writes the folder that
`ptt predict --model DIR` reads. `python train.py --help` lists the options.
"""

import sys


def main() -> None:
    """Run the training; Ctrl-C may end it at any moment, while it is being loaded as well."""
    try:
        from ptt.commands.main import run_alone

        run_alone("train")
    except KeyboardInterrupt:
        sys.stderr.write("error: interrupted\n")
        sys.exit(130)


if __name__ == "__main__":
    main()
