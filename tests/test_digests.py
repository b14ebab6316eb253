"""SHA-256 beside every file that a command writes, where asked for, as the system's own tool checks it."""

import hashlib
import re
from pathlib import Path

import pytest
from small_files import BARE

from ptt.commands.main import run
from ptt.files import write_text


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "machine.toml").write_text(BARE)
    (tmp_path / "targets.csv").write_text("x_cmd,y_cmd,z_cmd\n1,2,3\n4,5,6\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def checked(digest: Path) -> str:
    """The name that a digest is of, after it was compared with the file beside it, byte for byte."""
    found = re.fullmatch(r"([0-9a-f]{64})  (\S+)\n", digest.read_text())
    assert found and digest.name == f"{found[2]}.sha256"
    assert hashlib.sha256((digest.parent / found[2]).read_bytes()).hexdigest() == found[1]
    return found[2]


def test_every_file_has_its_digest_where_asked_for_and_none_elsewhere(place: Path, capsys) -> None:
    assert run(["predict", "targets.csv", "--model", "machine.toml", "--out", "plain.csv"]) == 0
    assert not list(place.glob("*.sha256"))
    assert run(["predict", "targets.csv", "--model", "machine.toml", "--out", "s.csv", "--sha256"]) == 0
    assert run(["export", "--model", "machine.toml", "--to", "c", "--out", "c", "--sha256"]) == 0
    names = sorted(checked(each) for each in place.rglob("*.sha256"))
    assert names == ["ptt_model.c", "ptt_model.h", "ptt_selftest.c", "s.csv"]


def test_a_digest_that_is_there_is_kept_true(place: Path, capsys) -> None:
    words = ["predict", "targets.csv", "--model", "machine.toml", "--out", "s.csv"]
    assert run([*words, "--sha256"]) == 0
    before = (place / "s.csv.sha256").read_text()
    write_text(place / "targets.csv", "x_cmd,y_cmd,z_cmd\n9,2,3\n4,5,6\n")
    assert run(words) == 0
    assert checked(place / "s.csv.sha256") == "s.csv" and (place / "s.csv.sha256").read_text() != before


@pytest.mark.parametrize("other", ["mine\n", "0" * 64 + "  other.csv\n", "folder"])
def test_what_is_no_digest_is_not_replaced(place: Path, capsys, other: str) -> None:
    beside = place / "s.csv.sha256"
    beside.mkdir() if other == "folder" else beside.write_text(other)
    words = ["predict", "targets.csv", "--model", "machine.toml", "--out", "s.csv"]
    assert run([*words, "--sha256"]) == 2
    assert "s.csv.sha256" in capsys.readouterr().err and not (place / "s.csv").exists()
    assert run(words) == 0  # and without a digest being asked for it is nobody's business
    assert beside.is_dir() if other == "folder" else beside.read_text() == other


def test_a_folder_that_is_one_thing_has_its_digests_inside(place: Path, capsys) -> None:
    rows = (Path(__file__).resolve().parents[1] / "data" / "sealed_three" / "run.csv").read_text().splitlines()
    (place / "run.csv").write_text("\n".join(rows[:40]) + "\n")
    assert run(["train", "run.csv", "--machine", "machine.toml", "--out", "comp", "--sha256"]) == 0
    assert not list(place.glob("*.sha256"))
    assert run(["predict", "targets.csv", "--model", "comp", "--out", "s.csv"]) in (0, 3)
