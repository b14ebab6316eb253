"""Train a compensator from a tracker run: python train.py RUN.csv --machine M.toml --out DIR.

Fits the effects of the machine file, lets the RBF network learn what is left, and writes the folder that
`ptt predict --model DIR` reads. `python train.py --help` lists the options.
"""

from ptt.commands.main import run_alone


def main() -> None:
    """Run the training."""
    run_alone("train")


if __name__ == "__main__":
    main()
