"""A folder with a short run, targets and the machine: for tests of `import ptt`.

A fixture is imported under its own name (`here as here`): no line calls it, pytest finds it in the test file.
"""

from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "data"
SEALED = DATA / "sealed_one"


@pytest.fixture(scope="module")
def here(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("library")
    pd.read_csv(SEALED / "run.csv", dtype=str, keep_default_na=False, nrows=120).to_csv(folder / "run.csv", index=False)
    pd.read_csv(SEALED / "targets.csv", dtype=str, nrows=30).to_csv(folder / "targets.csv", index=False)
    (folder / "machine.toml").write_text((SEALED / "machine.toml").read_text())
    return folder
