"""What stands for the diagnosis of a run in tests of a store: it loads no torch, so a worker is there soon."""

import time

from ptt.fleet.task import Outcome


def outcome(task, solved: bool = True) -> Outcome:
    made = task.drawing if solved and task.solved is None else None
    did = "diagnosis" if task.solved is None else "recheck"
    return Outcome(task.run, task.machine, did, "same", task.date, 0.01, 5.0, solved=made)


def slow(task):
    """What takes long enough to be killed in its middle."""
    time.sleep(0.1)
    return outcome(task)


def deadly(task):
    """What no worker brings to its end."""
    if task.machine == "m0":
        raise MemoryError
    return outcome(task)
