"""How far work has come: which stage, how fast, how long still; the same words for a terminal and a page."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

Progress = Callable[[str, int, int], None]  # what is done, how much of how much
Tell = Callable[[str], None]  # the stage alone, where nobody knows how much is to come
SMOOTH = 3  # steps of a stage before its pace says anything


@dataclass
class StagePace:
    """Follows what `Progress` is told; a stage ends where the count starts anew.

    Attributes:
        clock: s.
        stage: number of the present stage, from 1.
    """

    clock: Callable[[], float] = time.monotonic
    stage: int = 0
    _began: float = 0.0
    _at: tuple[int, int] = field(default=(0, -1))

    def words(self, done: int, of: int) -> str:
        """What there is to say of the pace.

        Args:
            done: how much is done.
            of: of how much; 0 where nobody knows.

        Returns:
            For example '12 of 50, 3.1 a second, 12 s left'; '' where nothing is counted.
        """
        if of != self._at[1] or done < self._at[0]:
            self.stage += 1
            self._began = self.clock()
        self._at = (done, of)
        if of <= 0:
            return ""
        spent = self.clock() - self._began
        if done < min(SMOOTH, of) or spent <= 0.0:
            return f"{done} of {of}"
        rate = done / spent
        return f"{done} of {of}, {_rate(rate)}, {_left((of - done) / rate)}"


def _rate(rate: float) -> str:
    return f"{rate:.3g} a second" if rate >= 0.5 else f"{60.0 * rate:.2g} a minute"


def _left(seconds: float) -> str:
    """A time in the unit in which one thinks of it."""
    if seconds < 90.0:
        return f"{seconds:.0f} s left"
    return f"{seconds / 60.0:.0f} min left" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h left"


def unwatched(what: str, done: int, of: int) -> None:
    """Take progress where nobody watches."""
