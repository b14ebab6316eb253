"""What one run asks for and what comes of it: plain values that travel between processes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

Did = Literal["check", "diagnosis", "recheck", "nothing"]


@dataclass(frozen=True)
class Task:
    """One run of one machine to be worked on.

    Attributes:
        run: SHA-256 of the run's file.
        machine: name of the machine.
        date: when it was measured, ISO 8601.
        file: name of the run's file, for messages.
        columns: its readings, title -> (n,).
        drawing: the machine.toml as it was given.
        solved: the machine.toml with what an earlier run showed; None where no run was diagnosed yet.
        ordered: whether somebody said that the rows are in travel order.
        units_said: whether somebody said in which units the columns are.
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
    """What a run says of the parameters of a model, with everything that a set-up may hold left free beside them.

    Around zero in usual sizes the rows' sum of squares is `x I x - 2 h x` and a constant: sums of this kind add up
    over runs.

    Attributes:
        names: 'effect parameter', one for each of p values.
        labels: the same for a person.
        units: of each.
        usual: (p,) usual sizes.
        information: (p, p) I.
        score: (p,) h.
        values: (p,) as fitted, in their own units.
        std: (p,) of what the rows see of each, in their own units; NaN where they see nothing.
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
    """What came of a run.

    Attributes:
        run: SHA-256 of its file.
        machine: name of the machine.
        did: what was done with it last.
        verdict: 'setup', 'failed', of a first run 'missing', 'nothing-missing' or 'unknown', of a later one 'same',
            'changed' or 'new'.
        words: for a person.
        seconds: that it took.
        error_um: what is left with the model, root mean square over the rows; of a later run with the model as it was.
        expected_um: what had been left when the model was made.
        noise_um: the noise floor.
        check: findings on the set-up, as `ptt check --json` has them.
        diagnosis: as `ptt diagnose --json` has it, of a first run.
        recheck: as `ptt recheck --json` has it, of a later one.
        solved: a machine.toml that later runs are to be compared with; None where the old one stays.
        refit: the machine.toml as this run alone would have it.
        told: what the run says of the parameters.
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
