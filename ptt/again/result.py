"""The result of a recheck: verdict, changed values, diagnosis of what is new, and their words."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

from ptt.again.figures import Moved
from ptt.again.words import explain
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.model.model import Model
from ptt.notebook import InNotebook
from ptt.record import Record

Verdict = Literal["same", "changed", "new"]
SHOWN_VALUES = 12  # rows of the printed table, at most


@dataclass(frozen=True)
class ChangedValue(Record):
    """One value that has changed.

    Attributes:
        moved: its figures in the model and in this run.
        repaired: whether it is back near zero.
        indistinguishable_from: other changes, or new effects, that explain the run as well.
        words: for a machinist.
    """

    keys: ClassVar[str] = "**: moved, repaired, indistinguishable_from, words"

    moved: Moved
    repaired: bool
    indistinguishable_from: tuple[str, ...]
    words: str


@dataclass(frozen=True)
class Recheck(InNotebook, Record):
    """A run against a solved model: has the machine changed since?

    Attributes:
        verdict: 'same', 'changed' or 'new'.
        changed: values that have changed, the largest |z| first.
        new: the diagnosis of what the model does not have; None where nothing is new.
        parameters: all values of the model and of this run: the changed ones estimated jointly, each other one as if it
            alone had changed as well.
        error_um: rms error of the readings: 'expected' of an unchanged machine, 'now' with the model as it was, 'left'
            with the changes.
        made_um: tool error that each effect causes in this run, rms: 'before' with the model's values, 'now' with those
            of this run.
        other_machine: whether so much is otherwise at once that the run may be of another machine.
        noise_um: the noise floor of this run.
        since: date of the model, ISO 8601; None where it does not say.
        rows: readings that counted.
        outlier_rows: rows left out as gross errors.
        notes: further remarks for the user.
        words: the verdict for a machinist.
        model: the solved model with the values of this run.
    """

    keys: ClassVar[str] = (
        "verdict, changed, suggested, new, parameters, error_um, made_um, other_machine, noise_um, since, rows, "
        "outlier_rows, notes, words"
    )

    verdict: Verdict
    changed: tuple[ChangedValue, ...]
    new: Diagnosis | None
    parameters: tuple[Moved, ...]
    error_um: dict[str, float]
    made_um: dict[str, dict[str, float]]
    other_machine: bool
    noise_um: dict[str, Any]
    since: str | None
    rows: int
    outlier_rows: tuple[int, ...]
    notes: tuple[str, ...]
    words: str
    model: Model

    @property
    def suggested(self) -> tuple[tuple[str, ...], ...]:
        """Steps of the diagnosis of what is new."""
        return () if self.new is None else self.new.suggested

    def with_unexplained(self, words: str) -> "Recheck":
        """The recheck with its diagnosis headed by a set-up problem (`Diagnosis.with_unexplained`); else as it is.

        Args:
            words: of the set-up check on columns that disagree beyond any machine's errors; '' for none.
        """
        if self.new is None or (new := self.new.with_unexplained(words)) is self.new:
            return self
        headed = replace(self, new=new)
        return replace(headed, words=explain(headed))

    def __str__(self) -> str:
        """The recheck as a person reads it."""
        lines = [f"verdict: {self.verdict}", "", self.words, "", *self._table(), ""]
        errors, noise = self.error_um, self.noise_um
        left = f", with the named changes {errors['left']:.2f}" if self.changed else ""
        lines.append(
            f"error in um: expected {errors['expected']:.2f}, with the old model {errors['now']:.2f}{left}; "
            f"noise {noise['total']:.2f} ({noise['source']})"
        )
        lines += [f"note: {note}" for note in self.notes]
        return "\n".join(lines)

    def _table(self) -> list[str]:
        head = f"{'value':<40} {'before':>12} {'now':>12} {'std':>10} {'z':>7}"
        named = {(item.moved.effect, item.moved.name) for item in self.changed}
        order = sorted(self.parameters, key=lambda one: ((one.effect, one.name) not in named, -abs(one.z)))
        rows = [
            f"{'*' if (one.effect, one.name) in named else ' '} {f'{one.effect} {one.name}':<38} {one.before:>12.5g} "
            f"{one.now:>12.5g} {one.std:>10.2g} {one.z:>7.1f}"
            for one in order[:SHOWN_VALUES]
        ]
        more = [f"  and {len(order) - SHOWN_VALUES} more in --json"] if len(order) > SHOWN_VALUES else []
        marks = ["* has changed. Each other row shows what that value would be if it alone had changed as well."]
        return [head, *rows, *more, *marks]
