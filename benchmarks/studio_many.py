"""Many sessions on one studio: what server and workers hold in memory, and how long each waits for its diagnosis.

    python benchmarks/studio_many.py [--clients 50]

Each client is a session with a folder of its own, as the page makes it; all open the sample at once and share the
pool's processes. No browser draws anything: 50 of them would fill the machine that is measured. Linux.
"""

import argparse
import asyncio
import os
import statistics
import tempfile
import time
from pathlib import Path
from unittest.mock import MagicMock

from ptt.show.studio.controller import Studio
from ptt.show.studio.pool import Pool
from ptt.show.studio.results import Source
from ptt.show.studio.store import SessionStore

DATA = Path(__file__).resolve().parents[1] / "data" / "sealed_one"
PAGE = os.sysconf("SC_PAGE_SIZE")


def main() -> None:
    """Open all sessions, wait for their diagnoses, and print what was held."""
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("--clients", type=int, default=50)
    given = reader.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        asyncio.run(_all(Path(folder), given.clients))


async def _all(folder: Path, clients: int) -> None:
    store, pool = SessionStore(folder), Pool()
    memory: list[tuple[int, int]] = []
    watching = asyncio.create_task(_watch(memory))
    began = time.monotonic()
    studios = [Studio(store.fresh(str(number)), pool) for number in range(clients)]
    waited = await asyncio.gather(*(_one(studio, began) for studio in studios))
    watching.cancel()
    pool.close()
    most, processes = max(size for _, size in memory), max(count for count, _ in memory)
    print(f"{clients} clients: at most {most / 2**30:.2f} GB resident, in at most {processes} processes")
    print(f"diagnosed after {min(waited):.0f} s (first), {statistics.median(waited):.0f} s, {max(waited):.0f} s (last)")
    assert all(studio.session.diagnosis is not None for studio in studios), "somebody got nothing"


async def _one(studio: Studio, began: float) -> float:
    studio.attach(MagicMock())
    (studio.folder / "run.csv").write_bytes((DATA / "run.csv").read_bytes())
    await studio.open(Source("run.csv"), (DATA / "machine.toml").read_text(encoding="utf-8"))
    return time.monotonic() - began


async def _watch(memory: list[tuple[int, int]]) -> None:
    while True:
        memory.append(held(os.getpid()))
        await asyncio.sleep(0.5)


def held(pid: int) -> tuple[int, int]:
    """How many processes a process and its offspring are, and what they hold, bytes of resident memory."""
    try:
        size = int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return 0, 0
    below = [held(int(child)) for child in children]
    return 1 + sum(count for count, _ in below), size + sum(size for _, size in below)


if __name__ == "__main__":
    main()
