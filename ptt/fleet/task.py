"""The task of processing one run, and its outcome: plain values that are sent between processes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

Did = Literal["check", "diagnosis", "recheck", "nothing"]


@dataclass(frozen=True)
class Task:
    """One run of one machine that is to be processed.

    Attributes:
        run: SHA-256 of the run's file.
        machine: name of the machine.
        date: when it was measured, ISO 8601.
        file: name of the run's file, for messages.
        columns: its readings, title of a column -> (n,).
        drawing: text of the machine.toml as it was given.
        solved: text of the machine.toml fitted to an earlier run; None where no run was diagnosed yet.
        ordered: whether the user stated that the rows are in travel order.
        units_said: whether the user stated the units of the columns.
    """

    run: str
    machine: str
    date: str
    file: str
    columns: Mapping[str, np.ndarray] = field(repr=False)
    drawing: str = field(repr=False)
    solved: str | None = field(default=None, repr=False)
    ordered: bool = False
    units_said: bool = False


@dataclass(frozen=True)
class Testimony:
    """Normal equations of one run for the p parameters of its machine, what belongs to the set-up eliminated.

    As a function of the parameters x, in units of their usual sizes, the run's sum of squares is x I x - 2 h x and a
    constant. I and h of several runs can be added.

    Attributes:
        names: 'effect parameter' of each.
        labels: the same for a person.
        units: of each, as in the machine file.
        usual: usual size of each, (p,) in those units.
        information: I, (p, p).
        score: h, (p,).
        values: the fitted values, (p,) in their units.
        std: their standard errors, (p,) in their units: where only combinations with others are measured, nearly the
            usual size; NaN where the rows do not measure a value.
    """

    names: tuple[str, ...]
    labels: tuple[str, ...]
    units: tuple[str, ...]
    usual: np.ndarray
    information: np.ndarray
    score: np.ndarray
    values: np.ndarray
    std: np.ndarray


@dataclass(frozen=True)
class Outcome:
    """The outcome of processing one run.

    Attributes:
        run: SHA-256 of its file.
        machine: name of the machine.
        did: the last step that was done: 'check', 'diagnosis', 'recheck' or 'nothing'.
        verdict: 'setup', 'failed', of a first run 'missing', 'nothing-missing' or 'unknown', of a later one 'same',
            'changed' or 'new'.
        words: for a person.
        seconds: how long it took.
        error_um: rms error: of a first run with the fitted model, of a later one with the model as it was.
        expected_um: of a later run, rms error that it would have if the machine had not changed.
        noise_um: the noise floor.
        check: findings on the set-up, as `ptt check --json`.
        diagnosis: of a first run, as `ptt diagnose --json`.
        recheck: of a later run, as `ptt recheck --json`.
        solved: text of a machine.toml that later runs are to be compared with; None where the old one stays.
        refit: text of the machine.toml fitted to this run.
        told: what the run says of the parameters; None where it was not fitted.
    """

    run: str
    machine: str
    did: Did
    verdict: str
    words: str
    seconds: float
    error_um: float | None = None
    expected_um: float | None = None
    noise_um: float | None = None
    check: dict[str, Any] | None = None
    diagnosis: dict[str, Any] | None = None
    recheck: dict[str, Any] | None = None
    solved: str | None = None
    refit: str | None = None
    told: Testimony | None = None
