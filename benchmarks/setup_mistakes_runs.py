"""Sound set-ups: foreign machines with ordinary faults, measured from anywhere."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from ptt.machine import MachineFile
from ptt.rig.draw_faults import KNOWN, Scene
from ptt.rig.draw_foreign import draw_foreign
from ptt.rig.draw_odd import SHOWN_FAULTS
from ptt.rig.nominal import ideal_machine
from ptt.rig.rig import Rig
from ptt.rig.rig_file import parse_rig
from ptt.rig.schema import Section
from ptt.rig.simulate import simulate
from ptt.run.table import Table, make_table

Random = np.random.Generator


@lru_cache(maxsize=64)
def draw_run(seed: int, faults: int = 1, rows: int | None = None) -> tuple[MachineFile, Table]:
    """A sound set-up: a foreign machine with ordinary faults, unknown ones among them, measured from anywhere.

    Args:
        seed: of everything.
        faults: how many.
        rows: about how many readings; None lets the seed choose.

    Returns:
        The drawing and the run.
    """
    random = np.random.default_rng([seed, 404])
    protocol = str(random.choice(["path", "volume", "payload", "warmup", "speed"]))
    drawn = draw_foreign(seed, protocol, rows=rows or int(np.exp(random.uniform(np.log(24), np.log(600)))))  # type: ignore[arg-type]
    rig = drawn.rig
    for _ in range(faults):
        rig = _harm(rig, protocol, random, drawn.half_size)
    frame = simulate(rig, drawn.targets).frame
    columns = {title: frame[title].to_numpy() for title in frame.columns if title not in drawn.absent}
    return rig.machine, _stand_anywhere(_tabulate(columns), rig.machine, random)


def _harm(rig: Rig, protocol: str, random: Random, half_size: np.ndarray) -> Rig:
    """One fault more, of the library or of none, up to 1 mm."""
    kinds = (SHOWN_FAULTS, KNOWN) if random.random() < 0.3 else (KNOWN,)
    fits = next(found for kind in kinds if (found := [item for item in kind if protocol in item.protocols]))
    item = fits[int(random.integers(len(fits)))]
    values = item.draw(random, Scene(ideal_machine(rig.spec), rig.spec, half_size))
    values = {key: value for key, value in values.items() if not key.endswith("_share")}
    if item.section == "odd":
        content = {key: value for key, value in rig.spec.model_dump(mode="json").items() if value is not None}
        return replace(rig, odd=(*rig.odd, *parse_rig({"machine": content, "odd": [values]}).odd))
    section: Section = getattr(rig, item.section)
    changed = type(section).model_validate({**section.model_dump(exclude_defaults=True), **values})
    return replace(rig, **{item.section: changed})


def _tabulate(columns: dict[str, np.ndarray]) -> Table:
    def block(titles: list[str]) -> np.ndarray | None:
        return np.column_stack([columns[title] for title in titles]) if titles[0] in columns else None

    extra: dict[str, Any] = {key: columns.get(key) for key in ("time_s", "payload_kg", "temp_c", "feed_mm_s")}
    names = np.array([str(name) for name in columns.get("name", [])])
    blocks = [block([f"{axis}_cmd" for axis in "xyz"]), block([f"b{leg}_cmd" for leg in (1, 2, 3)])]
    blocks.append(block([f"{axis}_meas" for axis in "xyz"]))
    table = make_table(*blocks, **{key: value for key, value in extra.items() if value is not None})
    role = np.array([str(value) for value in columns.get("role", ["pose"] * table.rows)])
    return table.replace(role=role, name=names if len(names) else table.name)


def _stand_anywhere(table: Table, file: MachineFile, random: Random) -> Table:
    """Half of the stations stand turned about z anywhere in the hall, a few of them lie on their side."""
    if file.tracker.frame == "trusted" or random.random() < 0.5:
        return table
    turn = draw_turn(random, upright=random.random() < 0.8)
    return table.replace(measured=table.measured @ turn.T + random.uniform(-4000.0, 4000.0, 3))


def draw_turn(random: Random, upright: bool) -> np.ndarray:
    if upright:
        angle = random.uniform(-np.pi, np.pi)
        return np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    square, _ = np.linalg.qr(random.standard_normal((3, 3)))
    return square * np.sign(np.linalg.det(square))
