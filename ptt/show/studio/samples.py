"""Sample runs in the source tree, and levels of challenges."""

from pathlib import Path

from ptt.show.studio.results import SEAL

DATA = (Path(__file__).resolve().parents[3] / "data", Path("data").resolve())  # of the sources, or of where it runs
SAMPLES = {
    "sealed_one": "One hidden fault (296 readings)",
    "sealed_three": "Three hidden faults (300 readings)",
    "arm": "A serial arm with a fault (220 readings)",
}
FIRST, ARM = "sealed_three", "arm"  # samples with a button of their own
LEVELS = {
    "single": "One effect is hidden", "multi": "Several effects", "unknown": "One that is in no library",
    "none": "Nothing", "any": "Any of these",
}  # fmt: skip


def sample_files(name: str) -> tuple[Path, ...] | None:
    """Files of a sample.

    Args:
        name: one of `SAMPLES`.

    Returns:
        Paths of run, machine, targets, and the seal where there is one; None where the sample is not found.
    """
    for folder in DATA:
        files = tuple(folder / name / file for file in ("run.csv", "machine.toml", "targets.csv", SEAL))
        if all(file.exists() for file in files[:3]):
            return tuple(file for file in files if file.exists())
    return None
