"""Finding a run of a machine by its file name, its date or its SHA-256."""

from collections.abc import Sequence
from typing import Any

from ptt.errors import InputError
from ptt.fleet.store import Store, shown

RUNS = """
SELECT runs.*, outcomes.verdict FROM runs LEFT JOIN outcomes USING (run) WHERE runs.machine = ? ORDER BY date, place"""
ENOUGH = 6  # least number of characters of a SHA-256 by which a run may be named


def which_run(store: Store, machine: str, which: str | None = None) -> dict[str, Any]:
    """Find one run of a machine.

    Args:
        store: the store.
        machine: its name.
        which: file name, date or beginning of its SHA-256; None for the last run by date.

    Returns:
        Its row of the table of runs, with its verdict, None where it was not processed yet.

    Raises:
        InputError: no such machine, no such run, or several.
    """
    runs = store.ask(RUNS, machine)
    if not runs and not store.ask("SELECT 1 FROM machines WHERE machine = ?", machine):
        raise InputError(f"no machine '{shown(machine)}'", where=str(store.folder), fix="`ptt fleet show` lists them")
    found = runs[-1:] if which is None else [run for run in runs if _is_meant(run, which)]
    if len(found) != 1:
        what = f"{'no run' if not found else f'{len(found)} runs'} of '{shown(machine)}'{_called(which)}"
        raise InputError(what, where=str(store.folder), fix=f"name one by its file: {_listed(found or runs)}")
    return found[0]


def _is_meant(run: dict[str, Any], which: str) -> bool:
    day = run["date"].isoformat()
    return which in (run["file"], day, day[:10]) or (len(which) >= ENOUGH and run["run"].startswith(which.lower()))


def _called(which: str | None) -> str:
    return "" if which is None else f" is called '{shown(which)}'"


def _listed(runs: Sequence[dict[str, Any]]) -> str:
    return ", ".join(shown(run["file"]) for run in runs[-6:]) or "it has none"
