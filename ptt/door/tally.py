"""Figures of commands, which add up over parts: counts, largest values, first rows of each status."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ptt.correct.commands import ROUNDING, STATUSES, UNCERTAIN, Commands
from ptt.run.table import Table

LINES_SHOWN = 5
SENT = ("ok", UNCERTAIN)


@dataclass(frozen=True)
class Tally:
    """Figures of some rows.

    Attributes:
        rows: number of targets.
        status: number of rows of each status.
        first: lines in the file of the first rows of each status.
        in_domain: number of rows inside the network's training domain.
        gap: largest distance of the tool between the exact and the first-order command, mm.
        shift: largest static correction that is sent, mm.
        sigma: largest uncertainty of those that are sent, mm; None where nothing tells.
        missed: largest distance between the target and where the command brings the tool by the model, mm.
        reversal: largest reversal compensation, mm or rad.
        words: who compensates what at a reversal.
        arm: whether the machine is an arm, with angles in rad.
        approached: rows that are uncertain mostly because the joints' direction of arrival at the first row is unknown.
        base: rows of base reflectors beside the targets, at which the machine stands.
    """

    rows: int
    status: dict[str, int]
    first: dict[str, tuple[int, ...]]
    in_domain: int
    gap: float
    shift: float
    sigma: float | None
    missed: float
    reversal: float
    words: str
    arm: bool = False
    approached: int = 0
    base: int = 0

    @property
    def sent(self) -> int:
        """Rows with a command to send."""
        return sum(self.status[status] for status in SENT)

    def __add__(self, other: "Tally") -> "Tally":
        """Figures of these rows and of further ones."""
        return Tally(
            self.rows + other.rows,
            {name: count + other.status[name] for name, count in self.status.items()},
            {name: (*lines, *other.first[name])[:LINES_SHOWN] for name, lines in self.first.items()},
            self.in_domain + other.in_domain,
            max(self.gap, other.gap),
            max(self.shift, other.shift),
            max((each for each in (self.sigma, other.sigma) if each is not None), default=None),
            max(self.missed, other.missed),
            max(self.reversal, other.reversal),
            self.words,
            self.arm,
            self.approached + other.approached,
            self.base + other.base,
        )

    def figures(self) -> dict[str, Any]:
        """For JSON."""
        unit, times = ("urad", 1e6) if self.arm else ("um", 1e3)
        return {
            "form": "exact inversion",
            "first_order_difference_um": 1e3 * self.gap,
            "largest_shift_um": 1e3 * self.shift,
            "largest_sigma_um": None if self.sigma is None else 1e3 * self.sigma,
            "largest_missed_um": 1e3 * self.missed,
            "reversal": self.words,
            f"largest_reversal_{unit}": times * self.reversal,
        }

    def warnings(self, source: str, *, network: bool) -> list[str]:
        """What a person should know before these are sent.

        Args:
            source: the targets' file.
            network: whether a network took part.
        """
        lines = []
        if self.sent < self.rows:
            kinds = [self._told(status) for status in self.status if status not in SENT]
            count = f"{self.rows - self.sent} of {self.rows} rows are not sent"
            lines.append(f"{source}: {count}: {'; '.join(kind for kind in kinds if kind)}")
        if unsure := self._told(UNCERTAIN):
            why = [] if self.approached == self.status[UNCERTAIN] else [self._why_unsure()]
            if self.approached:
                many = f" for {self.approached} of them" if why else ""
                way = "state it in columns dir1.. there, or begin with a longer approach; keep rows where joints turn"
                what = "the side from which joints come to the first row, or how far past others where dir1.. has it,"
                why.append(f"{what} matters{many} and is not stated: {way}")
            lines.append(f"{source}: {unsure}: sent, but {'; '.join(why)}")
        if self.missed > ROUNDING:
            lines.append(
                f"{source}: by the model, commands miss by up to {1e3 * self.missed:.0f} um: some moves after a"
                " reversal are shorter than what changes over there, or no joint moves the tool that way, so that no"
                " command brings it to their end"
            )
        outside = self.rows - self.in_domain
        if outside and network:
            lines.append(f"{outside} of {self.rows} targets lie outside the network's training domain: physics only")
        return lines

    def _why_unsure(self) -> str:
        if (
            self.status[UNCERTAIN] == self.sent and not self.approached and self.missed <= ROUNDING
        ):  # of a model that helped not all are so
            return (
                "no command is certain: the model predicts held-out readings no better than the drawing does, or its"
                " values are less certain than its held-out error says"
            )
        less = "less certain there than the held-out error says"
        return f"{less}; measure near them and as soon after reversals" if self.missed <= ROUNDING else less

    def _told(self, status: str) -> str:
        count, lines = self.status[status], self.first[status]
        if not count:
            return ""
        named = ", ".join(map(str, lines))
        return f"{count} {status} (row{'s' if count > 1 else ''} {named}{', ...' if count > len(lines) else ''})"


def tally(table: Table, commands: Commands) -> Tally:
    """Figures of some rows.

    Args:
        table: the targets.
        commands: what to send there.
    """
    sent, counts = commands.sent, commands.counts
    known = commands.sigma[sent & (commands.sigma >= 0.0)]
    first = {name: tuple(table.line[commands.status == name][:LINES_SHOWN].tolist()) for name in STATUSES}
    largest = (commands.first_order_gap, commands.shift, commands.missed)
    gap, shift, missed = (float(values[sent].max(initial=0.0)) for values in largest)
    reversal = float(np.abs(commands.reversal[sent]).max(initial=0.0))
    sigma = float(known.max()) if len(known) else None
    inside = int(commands.in_domain.sum())
    words, arm = commands.reversal_note, table.joint_prefix == "q"
    mostly = (commands.status == UNCERTAIN) & (2.0 * np.square(commands.approach) > np.square(commands.sigma))
    approached, base = int(mostly.sum()), int((~commands.targets).sum())
    rows = len(sent) - base
    return Tally(rows, counts, first, inside, gap, shift, sigma, missed, reversal, words, arm, approached, base)
