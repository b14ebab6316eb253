"""Run docs/library.py cell by cell and write docs/library.md with what it prints: `python docs/make/library.py`."""

import contextlib
import io
import os
import re
import sys
import tempfile
from pathlib import Path

DOCS = Path(__file__).parents[1]
SCRIPT, BOOK = DOCS / "library.py", DOCS / "library.md"
MORE = """
## What else there is

- `ptt.compare, check, diagnose, add, remove, fit, train, predict, evaluate, recheck, export, simulate` hand back one
  result each: `.to_dict()` is what the verb prints with `--json`, `str()` what it prints without, `.plot()` a
  matplotlib figure, `.to_frame()` a table. In a notebook a result shows itself.
- Where a model belongs, the path of one will do, and so will a result that has one (`ladder`, what `train` hands
  back). Where a run belongs, a path or a data frame will do; where targets belong, an array (n, 3) in mm as well.
- `ptt.read(..., also=[...], targets=..., set={"payload_kg": 2}, map="answers.toml")` are the options of the command
  line; `anyway=True` goes on although the set-up looks mistaken.
- `ptt.effects.ColumnBend()` is an effect, as is `"column-bend"`; a class of your own that inherits
  `ptt.effects.Effect` is one as well ([effects.md](effects.md)).
- What is wrong raises a `ptt.errors.PttError` with the words of the command line ([messages.md](messages.md)); catch
  that one. Its kinds are `InputError` (a file, a value or a combination that you can mend), `SetupError` (a mistake in
  the set-up), `PosesError` (poses that cannot work) and `HostError` (a full disk, a closed output); where a C compiler
  is missing it is a plain `PttError`. `exit_code` is the status with which the command would end: of an `InputError` 2,
  but 3 of a `TooFewError` (a sound run with too little in it), an `UntestedError` (an effect that it cannot test) and a
  `WorkspaceError` (poses that the machine cannot reach, by `rows`).
- `ptt.commands.main.run(["compare", "run.csv", "--model", "machine.toml"])` runs a verb in the running process and
  hands its exit code back.

All names are in [api.md](api.md), all keys of the JSON in [json.md](json.md).
"""


def book() -> str:
    """The whole page."""
    cells = re.split(r"^# %% ?", SCRIPT.read_text(encoding="utf-8"), flags=re.M)[1:]
    names: dict[str, object] = {}
    parts = []
    for cell in cells:
        title, _, body = cell.partition("\n")
        if title.startswith("[markdown]"):
            parts.append(re.sub(r"^# ?", "", body, flags=re.M).strip())
            continue
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(body, str(SCRIPT), "exec"), names)
        parts.append(f"## {title.strip()}\n\n```python\n{body.strip()}\n```")
        if printed.getvalue().strip():
            parts.append(
                "```text\n" + "\n".join(line.rstrip() for line in printed.getvalue().rstrip().splitlines()) + "\n```"
            )
    return "\n\n".join(parts) + "\n" + MORE


def main() -> None:
    """Write the page; what the cells write goes into a folder that is thrown away."""
    root = DOCS.parent
    sys.path.insert(0, str(root))
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "data").symlink_to(root / "data")
        os.chdir(folder)
        text = book()
        os.chdir(root)
    BOOK.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
