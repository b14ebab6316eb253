"""What several test files share."""

import atexit
import gc
import os
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, settings

if TYPE_CHECKING:
    from ptt.machine import MachineFile
    from ptt.run.table import Table

# Before any library is loaded that hears it: more threads share sums out otherwise, and the last digits would change.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# A machine that is busy besides draws slowly, and so do its examples run: neither is an error of the program.
settings.register_profile("any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any machine")

BENCH = """
[machine]
kind = "three-ptt"
name = "bench"
base_radius_mm = 200
platform_radius_mm = 100
link_length_mm = 300
slider_travel_mm = [150, 420]
screw_lead_mm = 5
platform_mass_kg = 1
"""


@pytest.fixture
def bench() -> "MachineFile":
    """The machine of the hand-worked cases: R 200, r 100, L 300 mm."""
    from ptt.machine import parse_machine

    return parse_machine(BENCH, "bench.toml")


@pytest.fixture(scope="session")
def sound() -> "tuple[MachineFile, Table]":
    """A sample run and its machine: nothing is wrong with the set-up."""
    from ptt.machine import load_machine
    from ptt.run.reading import read_table

    folder = Path(__file__).parent.parent / "data" / "sealed_one"
    return load_machine(folder / "machine.toml"), read_table(folder / "run.csv")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, Any, Any]:
    """What is imported stays: the garbage collector goes through none of it, neither while it grows nor later."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()
        atexit.register(gc.unfreeze)  # a library that counts its objects calls those that stay leaks


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """A file whose tests share something costly runs in one process and first; other tests go wherever one is free."""
    from xdist.scheduler import LoadScopeScheduling

    files = {path.name: path.read_text() for path in Path(__file__).parent.glob("*.py") if path.name != "conftest.py"}
    shared = {name for name, text in files.items() if 'scope="module"' in text or "@lru_cache" in text}
    helpers = [f"\nfrom {Path(name).stem} import " for name in shared if not name.startswith("test_")]
    shared |= {name for name, text in files.items() if any(helper in text for helper in helpers)}
    served = {name for name, text in files.items() if "import server as server" in text}

    class BySharing(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.split("::")[0]
            if Path(file).name in served:
                return "the one server of the studio"
            return file if Path(file).name in shared else nodeid

    return BySharing(config, log)
