"""Folders replaced whole or not at all: whoever is killed leaves the old one or the new one."""

import os
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

from ptt import folders
from ptt.errors import InputError
from ptt.folders import recover_folder, require_own, write_folder

OWN = frozenset({"first", "second"})
ENDLESS = """
import sys
from pathlib import Path
from ptt import folders
if sys.argv[2] == "renames":
    folders._exchange = lambda first, second: False
number = int(sys.argv[3])
while True:
    number += 1
    with folders.write_folder(sys.argv[1], frozenset({"first", "second"})) as place:
        for name in ("first", "second"):
            (place / name).write_text(str(number) * 20_000)
    print(number, flush=True)
"""


def write(place: Path, text: str) -> None:
    with write_folder(place, OWN) as new:
        for name in sorted(OWN):
            (new / name).write_text(text)


def read(place: Path) -> set[str]:
    return {(place / name).read_text() for name in OWN}


@pytest.mark.parametrize("way", ["exchange", "renames"])
def test_a_killed_writer_leaves_one_whole_folder(tmp_path, way):
    place, number, random_ = tmp_path / "out", 1000, random.Random(4)
    write(place, str(number) * 20_000)
    for _ in range(6):
        words = [sys.executable, "-c", ENDLESS, str(place), way, str(number)]
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as writer:
            first = writer.stdout.readline()
            time.sleep(random_.uniform(0.0, 0.02))
            writer.kill()
            told = [first, *writer.stdout.read().split()]
        last = int(told[-1])
        recover_folder(place)
        (whole,) = read(place)  # both files of one writing
        number = int(whole[:4])
        assert number in (last, last + 1) and len(whole) == 80_000
    write(place, "done")
    assert read(place) == {"done"} and [each.name for each in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("swaps", [True, False])
def test_a_folder_is_replaced_and_nothing_is_left_beside_it(tmp_path, monkeypatch, swaps):
    if not swaps:
        monkeypatch.setattr(folders, "_exchange", lambda first, second: False)
    for text in ("old", "new"):
        write(tmp_path / "deep" / "out", text)
    assert read(tmp_path / "deep" / "out") == {"new"}
    assert [each.name for each in (tmp_path / "deep").iterdir()] == ["out"]


def test_a_failing_writer_changes_nothing(tmp_path):
    write(tmp_path / "out", "old")
    with pytest.raises(ZeroDivisionError), write_folder(tmp_path / "out", OWN) as new:
        (new / "first").write_text("half")
        1 / 0  # noqa: B018
    assert read(tmp_path / "out") == {"old"} and [each.name for each in tmp_path.iterdir()] == ["out"]


def test_a_folder_with_other_files_is_not_replaced(tmp_path):
    write(tmp_path / "out", "old")
    (tmp_path / "out" / "thesis.tex").write_text("years of work")
    for act in (lambda: require_own(tmp_path / "out", OWN), lambda: write(tmp_path / "out", "new")):
        with pytest.raises(InputError, match=r"thesis\.tex.*lost"):
            act()
    assert read(tmp_path / "out") == {"old"} and (tmp_path / "out" / "thesis.tex").exists()


def test_a_link_to_a_folder_stays_one(tmp_path):
    write(tmp_path / "real", "old")
    (tmp_path / "link").symlink_to("real")
    write(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink() and read(tmp_path / "real") == {"new"}


def test_what_living_processes_write_is_left_alone(tmp_path):
    with write_folder(tmp_path / "out", OWN) as new:
        (new / "first").write_text("mine")
        (new / "second").write_text("mine")
        write(tmp_path / "out", "theirs")
        assert new.is_dir()
    assert read(tmp_path / "out") == {"mine"}
    if os.name == "posix":
        assert (tmp_path / "out").stat().st_mode & 0o500 == 0o500
