"""Sample runs that come with the program's sources."""

from pathlib import Path

DATA = Path(__file__).resolve().parents[3] / "data"
SAMPLES = {"sealed_one": "One hidden fault (296 readings)", "sealed_three": "Three hidden faults (300 readings)"}
LEVELS = {
    "single": "One effect is hidden", "multi": "Several effects", "unknown": "One that is in no library",
    "none": "Nothing", "any": "Any of these",
}  # fmt: skip


def sample_files(name: str) -> tuple[Path, ...] | None:
    """Files of a sample.

    Args:
        name: one of `SAMPLES`.

    Returns:
        Run, machine, targets and seal; None where the sources are not there.
    """
    files = tuple(DATA / name / file for file in ("run.csv", "machine.toml", "targets.csv", "sealed.json"))
    return files if all(file.exists() for file in files) else None
