"""Files that belong together: a kill at any step of the writing leaves the old ones or the new, never some of each."""

import os
import signal
import sys
from pathlib import Path

import pytest

from ptt.correct.exports.whole import write_all

NAMES = ("a.c", "a.h", "t.c")
STEPS = (
    "open",
    "os.rename",
    "os.chmod",
    "os.mkdir",
    "os.remove",
    "os.rmdir",
    "ctypes.call_function",
    "tempfile.mkdtemp",
)

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no fork")


def killed_at(step: int, folder: Path, text: str) -> bool:
    """Write in a fork that ends itself at a step; whether it came to its end before."""
    child = os.fork()
    if child == 0:
        seen = 0

        def hook(event: str, given: tuple[object, ...]) -> None:
            nonlocal seen
            if event in STEPS:
                seen += 1
                if seen == step:
                    os.kill(os.getpid(), signal.SIGKILL)

        sys.addaudithook(hook)
        try:
            write_all({folder / name: text for name in NAMES})
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


@pytest.mark.parametrize("there", [True, False])
def test_a_kill_leaves_the_old_files_or_the_new(there: bool, tmp_path: Path) -> None:
    step, found = 1, []
    while True:
        folder = tmp_path / f"{step}"
        if there:
            write_all({folder / name: "old" for name in NAMES})
        ended = killed_at(step, folder, "new")
        found.append([(folder / name).read_text() if folder.is_dir() else "" for name in NAMES])
        write_all({folder / name: "after" for name in NAMES})
        assert sorted(each.name for each in folder.iterdir()) == sorted(NAMES)
        if ended:
            break
        step += 1
    assert step > 4 and all(len(set(each)) == 1 for each in found)
    assert {each[0] for each in found} == {"old" if there else "", "new"}
    assert [each.name for each in tmp_path.iterdir() if each.name.startswith(".")] == []


def test_other_files_of_the_folder_stay(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "away").mkdir()
    (tmp_path / "away" / "a.h").write_text("old")
    (tmp_path / "a.h").symlink_to("away/a.h")
    write_all({tmp_path / name: "new" for name in NAMES})
    assert (tmp_path / "notes.txt").read_text() == "mine" and (tmp_path / "away" / "a.h").read_text() == "new"
    assert (tmp_path / "a.h").is_symlink()
