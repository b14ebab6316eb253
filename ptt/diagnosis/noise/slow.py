"""A wander as it is reported: how much of it a run shows, and how long it lasts."""

from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.noise.wander import Wander

SECONDS = "s"


def share_within(wander: Wander, span: float) -> float:
    """Expected variance of a wander about its mean over a span, over the white variance.

    Args:
        wander: the wander.
        span: length of the run, in the unit of the time constant.
    """
    times = wander.constant / max(span, 1e-9)
    return wander.share * (1.0 - 2.0 * times * (1.0 + times * float(np.expm1(-1.0 / times))))


@dataclass(frozen=True)
class Slow:
    """A wander as it is reported.

    Attributes:
        wander: the wander.
        span: how long the run lasts, in the unit of its time constant.
        unit: 's', or 'readings' where there is no clock.
    """

    wander: Wander
    span: float
    unit: str

    @property
    def size(self) -> float:
        """Standard deviation that the run shows of it, over the noise: the frame takes the mean of a slow one."""
        return float(np.sqrt(share_within(self.wander, self.span)))

    @property
    def lasts(self) -> str:
        """How long it lasts, in words; a run does not tell a time constant longer than itself."""
        if self.wander.constant > self.span:
            return "over longer than the run, as a drift does"
        return f"over about {float(f'{self.wander.constant:.2g}'):g} {self.unit}"

    def to_dict(self) -> dict[str, float | None]:
        """For JSON."""
        timed = self.unit == SECONDS
        return {
            "share": self.wander.share,
            "constant_s": self.wander.constant if timed else None,
            "constant_rows": None if timed else self.wander.constant,
        }
