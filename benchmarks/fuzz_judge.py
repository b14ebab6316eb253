"""How a damaged case ended: what changed on the disk, and the class that this makes it."""

import hashlib
import json
import os
import re
import stat
from dataclasses import dataclass
from pathlib import Path

from fuzz_mutation import Mutation

BAD = ("internal", "wrong", "broken", "unclear", "leak", "hang")
OTHERS = (b";", b"<", b"%", b"(", b"M", b"G")  # firmware, pages and programs, which may be called anything as well
LINE = 600  # characters of a message
RENEWED = {verb: ("model.toml", "solved.toml", "arm_model.toml", "machine.toml") for verb in ("add", "fit", "remove")}
RENEWED |= {"simulate": ("run.csv", "also.csv", "arm.csv")}
RENEWED |= {"check": (*RENEWED["simulate"], *RENEWED["add"])}
RENEWED |= {"predict": ("sliders.csv", "targets.csv", "arm_targets.csv"), "plan": ("sliders.csv", "targets.csv")}
STORE = "store"  # of a fleet: what its verbs read and write at once


@dataclass(frozen=True)
class Ended:
    """How a process ended: exit code, what it printed, and its processor seconds."""

    code: int
    out: str
    err: str
    seconds: float


def digests(place: Path) -> dict[str, str]:
    """Every plain file below a folder with its SHA-256; links by what they point to."""
    found = {}
    for each in sorted(place.rglob("*")):
        name = str(each.relative_to(place))
        if each.is_symlink():
            found[name] = f"-> {os.readlink(each)}"
        elif each.is_file():
            found[name] = hashlib.sha256(each.read_bytes()).hexdigest()
        elif not each.is_dir():
            found[name] = f"kind {stat.S_IFMT(each.lstat().st_mode):o}"
    return found


def judge(
    ended: Ended,
    mutation: Mutation,
    words: list[str],
    out: str,
    before: dict[str, str],
    place: Path,
    expected: str | None,
) -> tuple[str, str]:
    """Class of an ended case, and why.

    Args:
        ended: how it ended.
        mutation: what was done to the inputs.
        words: the command line.
        out: name of the output that the sound command line writes.
        before: digests of all files before.
        place: its folder.
        expected: what the sound inputs print, where the same must be printed.

    Returns:
        One of the classes, and words.
    """
    after = digests(place)
    if ended.code == -1:
        return "hang", f"{ended.seconds:.0f} s"
    if re.search("error: unexpected [A-Z]|Traceback \\(most recent", ended.err) or ended.code not in (0, 1, 2, 3):
        return "internal", ended.err.strip().splitlines()[-1][-300:] if ended.err.strip() else f"exit {ended.code}"
    store = words[0] == "fleet"  # it is both read and written: a store in order is what fleet's own tests look at
    touched = [name for name in before if after.get(name) != before[name] and not (store and _in_store(name))]
    if ended.code == 0 and words[0] in RENEWED:  # an earlier output of the same kind, which is no input, may go
        touched = [name for name in touched if name not in RENEWED[words[0]] or not _is_output(name, words, place)]
    if touched:
        return "broken", f"{touched[0]} was changed (exit {ended.code})"
    new = [name for name in after if name not in before and not (store and _in_store(name))]
    stray = [name for name in new if Path(name).name.startswith(".")]
    if stray:
        return "broken", f"{stray[0]} was left"
    if any(sign in ended.err for sign in ("Warning:", "warnings.warn")):
        return "leak", ended.err[:300]
    if ended.code == 0:
        return _judge_done(ended, mutation, words, out, new, place, expected)
    if ended.code == 1:
        return "internal", "exit 1: " + ended.err.strip()[-300:]
    if ended.code == 3 and words[0] == "predict" and out in new and not ended.err.startswith("error:"):
        return "ok", ""
    return _judge_refused(ended, new, words)


def _is_output(name: str, words: list[str], place: Path) -> bool:
    """Whether a file is named once on a command line, by whatever link, and that as what is to be written."""
    leads = [index for index, word in enumerate(words) if _same_file(place / word, place / name)]
    return len(leads) == 1 and words[leads[0] - 1] in ("--out", "--out-run", "--out-model")


def _same_file(one: Path, other: Path) -> bool:
    try:
        return one.exists() and one.samefile(other)
    except (OSError, ValueError):  # no name of a file
        return False


def _in_store(name: str) -> bool:
    return name.split("/")[0] == STORE


def _judge_refused(ended: Ended, new: list[str], words: list[str]) -> tuple[str, str]:
    lines = ended.err.strip().splitlines()
    if words[:2] == ["fleet", "add"] and lines and "the others were" in lines[-1]:  # some of several files were added
        return "ok", ""
    if len(lines) != 1 or not lines[0].startswith("error: "):
        return "unclear", f"{len(lines)} lines: {ended.err[:200]!r}"
    if len(lines[0]) > LINE:
        return "unclear", f"{len(lines[0])} characters: {lines[0][:200]}"
    if not lines[0].isprintable():
        return "unclear", f"control characters: {lines[0][:200]!r}"
    if ended.out.strip() and words[:2] != ["effects", "check"]:
        return "unclear", f"refused, yet printed {ended.out[:100]!r}"
    if new and words[:2] != ["effects", "check"]:
        return "broken", f"refused, yet wrote {new[0]}"
    return "refused", ""


def _judge_done(
    ended: Ended, mutation: Mutation, words: list[str], out: str, new: list[str], place: Path, expected: str | None
) -> tuple[str, str]:
    if mutation.verdict == "refuse":
        return "wrong", "accepted"
    if words[-1] == "--json" and "--help" not in words and not words[-2].startswith("-"):
        try:
            json.loads(ended.out, parse_constant=lambda text: (_ for _ in ()).throw(ValueError(text)))
        except ValueError as error:
            return "broken", f"standard output is no JSON: {error}: {ended.out[:100]!r}"
    if expected is not None and _but_lines(ended.out) != _but_lines(expected):
        return "wrong", "another result for the same input written otherwise"
    if (
        out
        and out in words
        and max(words.count(option) for option in ("--out", "--out-run")) < 2
        and not any(name == out or name.startswith(f"{out}/") for name in new)
    ):
        return "broken", f"exit 0 without {out}"
    return _judge_outputs([place / name for name in new])


def _but_lines(text: str) -> str:
    """Without the numbers of lines, which a comment before them shifts."""
    return re.sub(r'"line": \d+', "", text)


def _judge_outputs(paths: list[Path]) -> tuple[str, str]:
    """Whether we can read our own outputs."""
    import pandas as pd

    from ptt.commands.outputs import file_kind
    from ptt.errors import PttError
    from ptt.machine import load_machine

    for path in paths:
        try:
            if file_kind(path) == "machine":  # by what it holds: a command line may call it anything
                load_machine(path)
            elif path.suffix == ".csv" and not path.read_bytes().lstrip().startswith(OTHERS):
                pd.read_csv(path, comment="#")
            elif path.suffix == ".json":
                json.loads(path.read_text())
        except (PttError, ValueError, RecursionError) as error:
            return "broken", f"{path.name}: {str(error)[:200]}"
    return "ok", ""
