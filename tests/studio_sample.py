"""The studio's sample without a browser: its files in a folder of a session, and what its first jobs find.

A fixture is imported under its own name (`folder as folder`): no line calls it, pytest finds it in the test file.
"""

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ptt.commands.main import app
from ptt.show.studio import jobs
from ptt.show.studio.looks import Look
from ptt.show.studio.results import Changed, Source
from ptt.show.studio.session import Session

DATA = Path(__file__).resolve().parents[1] / "data" / "sealed_one"
MACHINE = (DATA / "machine.toml").read_text(encoding="utf-8")
RUN = Source("run.csv")
OWNER = "a" * 43


def silent(what: str, done: int = 0, of: int = 0) -> None:
    """Progress that nobody watches."""


def verb(*words: object) -> dict:
    """What a verb prints with --json."""
    outcome = CliRunner().invoke(app, [*map(str, words), "--json"])
    assert outcome.exit_code == 0, outcome.stderr
    return json.loads(outcome.stdout)


def fresh(look: Look | None = None) -> Session:
    return Session().opened(RUN, MACHINE).remembering(look=look)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session's folder with the sample in it, of its run the first half."""
    place = tmp_path_factory.mktemp("studio")
    for file in DATA.iterdir():
        shutil.copy(file, place)
    lines = (DATA / "run.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    (place / "run.csv").write_text("".join(lines[:161]), encoding="utf-8")
    return place


@pytest.fixture
def here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The same as the working folder, as the worker has it."""
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture(scope="module")
def added(folder: Path) -> Changed:
    """The sample with the effect that was hidden."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return jobs.change(RUN, MACHINE, "add", ("backlash",), silent)


@pytest.fixture(scope="module")
def look(folder: Path) -> Look:
    """The sample held against its drawing."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return jobs.look(RUN, MACHINE, silent)
