"""Results of a set-up check: findings, each with one sentence of proof and one fix."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, get_args

import numpy as np

from ptt.notebook import InNotebook
from ptt.record import Record
from ptt.setup.names import Mistake

if TYPE_CHECKING:
    from ptt.machine import MachineFile
    from ptt.run.table import Table

MISTAKES: tuple[Mistake, ...] = get_args(Mistake)
SHOWN_TIES = 3  # alternatives named in a sentence: a longer list is not read


@dataclass(frozen=True)
class Finding(Record):
    """One mistake in how a machine or a run was set up.

    Attributes:
        mistake: its name.
        words: one sentence with the proof.
        fix: one cure.
        before_um: root mean square error as the files are, um; None where another figure is the proof.
        after_um: the same with the mistake undone.
        sure: whether only this mistake explains the data; such a finding stops a diagnosis.
        source: the run it was found in; '' for the machine file.
    """

    keys: ClassVar[str] = "mistake, words, fix, rms_um.before: before_um, rms_um.after: after_um, sure"

    mistake: Mistake
    words: str
    fix: str
    before_um: float | None = None
    after_um: float | None = None
    sure: bool = True
    source: str = ""

    def __str__(self) -> str:
        """Two lines: the mistake with its proof, and the fix."""
        return f"{'' if self.sure else 'perhaps '}{self.mistake}: {self.words}\n  {self.fix}"


def ties_in_words(others: Sequence[str]) -> str:
    """Alternatives that explain the data equally well, as the end of a finding's sentence; '' where there are none."""
    if not others:
        return ""
    more = len(others) - SHOWN_TIES
    shown = [*others[:SHOWN_TIES], *([f"{more} others"] if more > 1 else others[SHOWN_TIES:])]
    return f"; {' or '.join(shown)} would do the same"


@dataclass(frozen=True)
class Check(InNotebook):
    """Findings about one run and its machine, and both files with the sure ones undone.

    Attributes:
        findings: the sure ones first.
        file: the corrected machine.
        table: the corrected run; None where only a machine was checked.
        rows: number of rows checked.
        too_little: why the geometry could not be judged, '' where it could.
        unexplained: errors too large for faults of a machine that no known mistake explains; '' where there are none.
    """

    findings: tuple[Finding, ...]
    file: "MachineFile"
    table: "Table | None" = None
    rows: int = 0
    too_little: str = ""
    unexplained: str = ""

    @property
    def ok(self) -> bool:
        """Whether no finding is sure."""
        return not self.sure

    @property
    def sure(self) -> tuple[Finding, ...]:
        """The findings that stop a diagnosis."""
        return tuple(finding for finding in self.findings if finding.sure)

    def to_dict(self) -> dict[str, Any]:
        """Keys as `ptt check --json` writes them."""
        findings = [finding.to_dict() for finding in self.findings]
        return {"ok": self.ok, "findings": findings, "rows": self.rows} | {
            "too_little": self.too_little or None,
            "unexplained": self.unexplained or None,
        }

    def __str__(self) -> str:
        """The findings as text."""
        last = [f"too little to judge the set-up: {self.too_little}"] if self.too_little else []
        last += [self.unexplained] if self.unexplained else []
        lines = [*(str(finding) for finding in self.findings), *last]
        return "\n".join(lines) or f"no mistakes found in {self._held} ({self.rows} rows)"

    @property
    def _held(self) -> str:
        """What was checked, in words."""
        read = self.table is None or bool(np.isfinite(self.table.measured).all(axis=1).any())
        return "the set-up" if read else "targets and commands; there are no readings"


def setup_verdict(check: Check) -> dict[str, Any]:
    """The output of `ptt diagnose --json` where set-up mistakes stop the diagnosis.

    Args:
        check: with sure findings.

    Returns:
        The keys of a diagnosis: verdict "setup", the findings, and nothing suggested.
    """
    nothing: dict[str, Any] = {
        key: [] for key in ("suggested", "candidates", "not_testable", "depends_on", "measure_next")
    }
    setup = [finding.to_dict() for finding in check.findings]
    nothing["verdict_probability"] = dict.fromkeys(
        ("missing", "nothing-missing", "unknown"), 0.0
    )  # no verdict was computed
    return {"verdict": "setup", "setup": setup, **nothing, "rows": check.rows, "noise_um": None, "words": str(check)}
