"""Processing all waiting runs of a store in this process; each outcome is stored at once, however the rest ends."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

from ptt.fleet.owner import owner
from ptt.fleet.queue import claim, keep_outcome, next_task, release, waiting
from ptt.fleet.store import Store
from ptt.fleet.task import Outcome, Task
from ptt.progress import Progress, Tell, unwatched
from ptt.record import Record

Work = Callable[[Task, Tell], Outcome]


@dataclass
class Done(Record):
    """What one `ptt fleet run` did.

    Attributes:
        verdicts: verdict -> number of runs.
        elsewhere: number of runs that wait because another process has claimed their machines.
        lost: runs whose workers died or failed, and why; they wait for the next time.
    """

    keys: ClassVar[str] = "runs, verdicts, elsewhere, lost"

    verdicts: dict[str, int] = field(default_factory=dict)
    elsewhere: int = 0
    lost: list[str] = field(default_factory=list)

    @property
    def runs(self) -> int:
        """How many runs were processed."""
        return sum(self.verdicts.values())

    def count(self, verdict: str) -> None:
        """Count one run."""
        self.verdicts[verdict] = self.verdicts.get(verdict, 0) + 1

    def __str__(self) -> str:
        """One or two lines."""
        told = ", ".join(f"{count} {verdict}" for verdict, count in sorted(self.verdicts.items()))
        lines = [f"{self.runs} run{'s' if self.runs != 1 else ''} processed: {told}" if self.runs else "nothing new"]
        if self.elsewhere:
            lines.append(f"{self.elsewhere} more are left to another `ptt fleet run` that is working on their machines")
        if self.lost:
            lines.append(f"{len(self.lost)} runs did not come back and are still waiting: {', '.join(self.lost)}")
        return "\n".join(lines)


def run_all(store: Store, progress: Progress | None = None, work: Work | None = None) -> Done:
    """Process every waiting run.

    Args:
        store: the store.
        progress: told what is being done, how many runs are done of how many.
        work: processes one run; None for `ptt.fleet.work.work`.

    Returns:
        What was done.
    """
    from ptt.fleet.work import work as whole

    tell, done, do = progress or unwatched, Done(), work or whole
    with owner(store.workers) as name:
        total = sum(waiting(store).values())
        try:
            while (machine := claim(store, name)) is not None:
                while (task := next_task(store, machine)) is not None:
                    outcome = task if isinstance(task, Outcome) else do(task, _telling(tell, task, done.runs, total))
                    if keep_outcome(store, outcome):
                        done.count(outcome.verdict)
                release(store, name, machine)
        finally:
            release(store, name)
    done.elsewhere = sum(waiting(store).values())
    return done


def _telling(tell: Progress, task: Task, done: int, total: int) -> Tell:
    return lambda what: tell(f"{task.machine}, {task.date[:10]}: {what}", done, total)
