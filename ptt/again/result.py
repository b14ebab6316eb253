"""What a recheck says: the verdict, what has changed, what is new, and the words for it."""

import html
from dataclasses import dataclass
from typing import Any, Literal

from ptt.again.figures import Moved
from ptt.diagnosis.verdict import Diagnosis
from ptt.model.model import Model

Verdict = Literal["same", "changed", "new"]
SHOWN = 12  # values of a table that anybody reads


@dataclass(frozen=True)
class Changed:
    """One value that is otherwise than it was.

    Attributes:
        moved: then and now.
        repaired: whether it is back near zero.
        indistinguishable_from: other changes, or new effects, that would do as well.
        words: for a machinist.
    """

    moved: Moved
    repaired: bool
    indistinguishable_from: tuple[str, ...]
    words: str

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        ties = list(self.indistinguishable_from)
        return {
            **self.moved.to_dict(), "repaired": self.repaired, "indistinguishable_from": ties, "words": self.words,
        }  # fmt: skip


@dataclass(frozen=True)
class Recheck:
    """A run against a solved model: has the machine changed since?

    Attributes:
        verdict: 'same', 'changed' or 'new'.
        changed: what is otherwise than it was, the surest first.
        new: the diagnosis of what the model does not have; None where nothing is.
        parameters: every value that may have changed, then and now: the named ones together, each of the others as if
            it had changed besides.
        error_um: expected of a machine that has not changed, now with the model as it was, left with what is named.
        made_um: what each effect does to the tool in this run, then and now.
        noise_um: the noise floor of this run.
        since: date of the model, ISO 8601; None where it does not say.
        rows: readings that counted.
        outlier_rows: rows left out as gross errors.
        notes: what else is to be known.
        words: the verdict for a machinist.
        model: the solved model with its values as this run has them.
    """

    verdict: Verdict
    changed: tuple[Changed, ...]
    new: Diagnosis | None
    parameters: tuple[Moved, ...]
    error_um: dict[str, float]
    made_um: dict[str, dict[str, float]]
    noise_um: dict[str, Any]
    since: str | None
    rows: int
    outlier_rows: tuple[int, ...]
    notes: tuple[str, ...]
    words: str
    model: Model

    def to_dict(self) -> dict[str, Any]:
        """For JSON, keys as documented."""
        found = None if self.new is None else self.new.to_dict()
        return {
            "verdict": self.verdict,
            "changed": [item.to_dict() for item in self.changed],
            "suggested": [] if found is None else found["suggested"],
            "new": found,
            "parameters": [value.to_dict() for value in self.parameters],
            "error_um": self.error_um,
            "made_um": self.made_um,
            "noise_um": self.noise_um,
            "since": self.since,
            "rows": self.rows,
            "outlier_rows": list(self.outlier_rows),
            "notes": list(self.notes),
            "words": self.words,
        }

    def __str__(self) -> str:
        """The recheck as a person reads it."""
        lines = [f"verdict: {self.verdict}", "", self.words, "", *self._table(), ""]
        errors, noise = self.error_um, self.noise_um
        lines.append(
            f"error in um: expected {errors['expected']:.2f}, with the model as it was {errors['now']:.2f}, "
            f"with the changes named {errors['left']:.2f}; noise {noise['total']:.2f} ({noise['source']})"
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
            for one in order[:SHOWN]
        ]
        more = [f"  and {len(order) - SHOWN} more in --json"] if len(order) > SHOWN else []
        marks = ["* has changed; the others as if each had changed by itself besides"]
        return [head, *rows, *more, *marks]

    def _repr_html_(self) -> str:
        """The recheck in a notebook."""
        return f"<pre>{html.escape(str(self))}</pre>"
