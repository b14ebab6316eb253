"""Run the commands of docs/tutorial.md and hold what the page shows of their output against what they print."""

import contextlib
import io
import os
import re
import shlex
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from ptt.commands.main import run

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "tutorial.md"
CUT = "[...]"
SLACK = 0.1  # share by which a figure may differ; where it has decimals, two units of the last one it shows


def commands(page: str) -> Iterator[tuple[list[str], str]]:
    """Every `$ command` of a page with the output that is shown of it.

    Args:
        page: Markdown.

    Yields:
        Words of the command line, and the shown lines; '' where nothing is shown.
    """
    for block in re.findall(r"(?:^    \$ .*\n)(?:^(?:    .*)?\n)*", page, re.MULTILINE):
        for part in re.split(r"^    \$ ", block, flags=re.MULTILINE)[1:]:
            line, _, shown = part.replace("\\\n", " ").partition("\n")
            yield shlex.split(line, comments=True), shown


def differences(shown: str, printed: str) -> list[str]:
    """What a page shows that a command did not print; line breaks and the width of blanks do not count.

    Args:
        shown: lines, with [...] where something was left out.
        printed: all of the output.

    Returns:
        The parts that are not there, in this order, with all their words and about these figures.
    """
    at, missing, found = 0, [], _tokens(printed)
    for part in shown.split(CUT):
        wanted = _tokens(part)
        place = next((i for i in range(at, len(found) - len(wanted) + 1) if _alike(wanted, found[i:])), None)
        if place is None:
            missing.append(part.strip())
        else:
            at = place + len(wanted)
    return missing


def run_line(words: list[str]) -> tuple[int, str]:
    """Run a command line in this process.

    Args:
        words: of it; `> FILE` at its end is obeyed.

    Returns:
        Exit status and output.
    """
    target = None
    if ">" in words:
        words, target = words[: words.index(">")], words[words.index(">") + 1]
    verb = ["train", *words[2:]] if words[:2] == ["python", "train.py"] else words[1:]
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        status = run(verb)
    if target is not None:
        Path(target).write_text(out.getvalue())
    return status, "" if target else out.getvalue()


def failures(page: str) -> list[str]:
    """Run a page's commands in the working directory.

    Args:
        page: Markdown.

    Returns:
        One text for each command that fails, or prints something else than the page shows.
    """
    wrong = []
    for words, shown in commands(page):
        status, printed = run_line(words)
        missing = differences(shown, printed)
        if status or missing:
            lines = [f"$ {' '.join(words)}", f"exit {status}; not printed:", *missing, "but:", printed]
            wrong.append("\n".join(lines))
    return wrong


def _tokens(text: str) -> list[str]:
    return re.findall(r"\d+(?:\.\d+)?(?:e[-+]?\d+)?|[^\W\d]+|[^\w\s─]", text)


def _alike(wanted: list[str], found: list[str]) -> bool:
    return all(map(_same, wanted, found))


def _same(one: str, other: str) -> bool:
    if one == other or not (one[0].isdigit() and other[0].isdigit()):
        return one == other
    if "e" in one or "e" in other:
        return True  # a chance of 1e-174 is as small as one of 1e-170
    places = len(one.partition(".")[2])
    slack = 2.0 * 10.0**-places if places else 0.0  # a whole number may be a name: slider 2
    return abs(float(one) - float(other)) <= max(slack, SLACK * float(one))


def main() -> None:
    """Check the page in a folder of its own."""
    page = PAGE.read_text()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        (Path(folder) / "data").symlink_to(ROOT / "data")
        wrong = failures(page)
    print("\n\n".join(wrong) or f"{PAGE.name}: every command prints what the page shows")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
