"""Does what is measured next tell apart what a path could not? Rigs with one hidden fault on short, narrow paths.

Run it as `python benchmarks/separation.py [RIGS] [EXACT] [FIRST SEED]`. A rig counts where the diagnosis of its path
names the hidden fault among effects that do as well, none of them an exact ambiguity. The rows that `plan_separation`
chooses are then driven on the same rig, and both runs are diagnosed together. A second table counts exact ambiguities.
"""

import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch

from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.machine import MachineFile, load_machine
from ptt.model.model import Model
from ptt.plan.separation import Separation, plan_separation
from ptt.rig.rig import Rig
from ptt.rig.rig_file import parse_rig
from ptt.rig.simulate import simulate
from ptt.rig.targets import as_targets, make_helix, there_and_back
from ptt.run.problem import Problem, build_problem
from ptt.run.reading import read_table
from ptt.run.written import table_to_frame, write_table

Random = np.random.Generator
MOST_TRIED = 12  # rigs drawn for each that counts
SHARE = 0.4  # of the rigs that may hide the same fault


@dataclass(frozen=True)
class Case:
    """A hidden fault, the path that cannot tell it, and the run."""

    fault: str
    rig: Rig
    targets: pd.DataFrame


@dataclass(frozen=True)
class Outcome:
    """A path's diagnosis, what was measured next, and the diagnosis of both."""

    case: Case
    before: tuple[tuple[str, ...], ...]
    plan: Separation
    after: tuple[tuple[str, ...], ...]
    verdict: str

    @property
    def alone(self) -> bool:
        """The hidden fault is named, with no other beside it, and nothing else is."""
        return self.after == ((self.case.fault,),)


def machine() -> MachineFile:
    """The bench with a fitted frame, a platform of 1 kg, and nothing known of the noise beforehand."""
    file = load_machine(Path(__file__).resolve().parents[1] / "data" / "machine.toml")
    spec = file.machine.model_copy(update={"platform_mass_kg": 1.0, "reflector_mm": (20.0, -10.0, -40.0)})
    tracker = file.tracker.model_copy(update={"frame": "fitted", "sigma_mm": None, "base_point": ()})
    return replace(file, machine=spec, tracker=tracker)


def _on_legs(random: Random, low: float, high: float) -> list[float]:
    """Sizes on one leg or on all, either sign."""
    size = np.exp(random.uniform(np.log(low), np.log(high), 3)) * random.choice([-1.0, 1.0], 3)
    keep = np.arange(3) == random.integers(3) if random.random() < 0.5 else np.ones(3, dtype=bool)
    return [float(value) for value in np.where(keep, size, 0.0).round(6)]


FAULTS: dict[str, Callable[[Random], dict[str, Any]]] = {
    "link-length": lambda r: {"geometry": {"link_mm": _on_legs(r, 0.05, 0.2)}},
    "lead-scale": lambda r: {"drive": {"scale_um_per_m": _on_legs(r, 100.0, 400.0)}},
    "tower-tilt": lambda r: {
        "geometry": {"lean_radial_mrad": _on_legs(r, 0.5, 2.0), "lean_tangential_mrad": _on_legs(r, 0.5, 2.0)}
    },
    "tower-position": lambda r: {
        "geometry": {"tower_radial_mm": _on_legs(r, 0.1, 0.5), "tower_tangential_mm": _on_legs(r, 0.1, 0.5)}
    },
    "axis-compliance": lambda r: {"drive": {"compliance_um_per_n": np.abs(_on_legs(r, 0.1, 0.5)).tolist()}},
    "column-bend": lambda r: {"structure": {"column_bend_um_per_kg": r.uniform(-4.0, 4.0, 2).tolist()}},
    "backlash": lambda r: {"drive": {"backlash_mm": np.abs(_on_legs(r, 0.01, 0.05)).tolist()}},
}
LOADED = {"axis-compliance", "column-bend"}
EXACT: dict[str, Callable[[Random], dict[str, Any]]] = {
    "homing-offset": lambda r: {"drive": {"homing_mm": _on_legs(r, 0.2, 1.0)}},
    "joint-offset": lambda r: {"geometry": {"joint_offset_rail_mm": _on_legs(r, 0.1, 0.4)}},
}


def draw(seed: int, file: MachineFile, faults: dict[str, Callable[[Random], dict[str, Any]]]) -> Case:
    """Hide a fault and choose a path: a few turns of a narrow, flat helix, up and down, three times.

    Args:
        seed: of everything.
        file: the machine.
        faults: those that may be hidden.

    Returns:
        The case.
    """
    random = np.random.default_rng([seed, 41])
    fault = list(faults)[seed % len(faults)]
    hidden = faults[fault](random)
    radius, height = float(random.uniform(8.0, 35.0)), float(random.uniform(5.0, 50.0))
    rows = 40
    path = make_helix(rows, radius=radius, rise=height / rows, turns=float(random.uniform(1.0, 3.0)), start=-height / 2)
    conditions: dict[str, Any] = {"cycles": 3, "dwell_s": 3.0}
    if fault in LOADED:
        conditions["payload_per_cycle_kg"] = [0.0, 5.0, 0.0]
    angle = random.uniform(0.0, 2.0 * np.pi)
    tracker = {
        "white_mm": 0.004,
        "station_mm": [3000.0 * float(np.cos(angle)), 3000.0 * float(np.sin(angle)), 300.0],
        "translation_mm": random.uniform(-0.5, 0.5, 3).tolist(),
        "rotation_mrad": random.uniform(-0.5, 0.5, 3).tolist(),
    }
    bare = {key: value for key, value in file.machine.model_dump(mode="json").items() if value is not None}
    content = {"machine": {"kind": "three-ptt", **bare}, "seed": seed, "conditions": conditions, "tracker": tracker}
    rig = replace(parse_rig({**content, **hidden}), machine=file)
    return Case(fault, rig, as_targets(there_and_back(path)))


def measure(case: Case, folder: Path) -> tuple[Problem, Diagnosis]:
    """Run the path and diagnose it."""
    simulate(case.rig, case.targets, seed=1).frame.to_csv(folder / "path.csv", index=False)
    problem = build_problem(case.rig.machine, read_table(folder / "path.csv"))
    return problem, diagnose(Model(case.rig.machine), problem)


def measure_again(case: Case, plan: Separation, folder: Path) -> Diagnosis:
    """Drive what is to be measured next on the same rig, once, and diagnose both runs."""
    assert plan.targets is not None
    write_table(plan.targets, folder / "next.csv")
    wanted = read_table(folder / "next.csv", purpose="targets")
    once = case.rig.conditions.model_copy(update={"cycles": 1, "payload_per_cycle_kg": ()})
    rig = replace(case.rig, conditions=once)
    again = simulate(rig, table_to_frame(wanted).assign(role=wanted.role), seed=2)
    again.frame.to_csv(folder / "more.csv", index=False)
    both = read_table(folder / "path.csv", also=[folder / "more.csv"])
    return diagnose(Model(case.rig.machine), build_problem(case.rig.machine, both))


def confused(case: Case, found: Diagnosis) -> bool:
    """The hidden fault is among several that the first step could be."""
    return len(found.suggested) == 1 and len(found.suggested[0]) > 1 and case.fault in found.suggested[0]


def separate(case: Case, folder: Path) -> Outcome | str:
    """One rig from path to verdict, or why it does not count."""
    problem, found = measure(case, folder)
    if not confused(case, found):
        return "alone" if found.suggested == ((case.fault,),) else "otherwise"
    plan = plan_separation(found.fitted, problem, found.suggested)
    assert plan is not None
    if plan.targets is None or any(pair.exact for pair in plan.pairs):
        return "exact"
    again = measure_again(case, plan, folder)
    return Outcome(case, found.suggested, plan, again.suggested, again.verdict)


def by_path(rigs: int, start: int, folder: Path) -> tuple[list[Outcome], Counter[str]]:
    """Rigs whose path confounds two effects, told apart or not; and how many were drawn that do not count."""
    file, outcomes, others, had = machine(), [], Counter[str](), Counter[str]()
    for seed in range(start, start + MOST_TRIED * rigs):
        case = draw(seed, file, FAULTS)
        if had[case.fault] >= max(SHARE * rigs, 1.0):
            continue
        outcome = separate(case, folder)
        if isinstance(outcome, str):
            others[outcome] += 1
            continue
        outcomes.append(outcome)
        had[case.fault] += 1
        tell(seed, outcome)
        if len(outcomes) == rigs:
            break
    return outcomes, others


def exactly(rigs: int, start: int, folder: Path) -> tuple[int, int, list[str]]:
    """Rigs with an exact ambiguity: how many there were, how many were named as such, and what is said."""
    file, count, named, said = machine(), 0, 0, []
    for seed in range(start, start + MOST_TRIED * rigs):
        case = draw(seed, file, EXACT)
        problem, found = measure(case, folder)
        pair = set(EXACT)
        step = next((step for step in found.suggested if pair <= set(step)), None)
        if step is None:
            continue
        plan = plan_separation(found.fitted, problem, found.suggested)
        assert plan is not None
        told = [item for item in plan.pairs if {item.pick, item.rival} == pair]
        count += 1
        # A pair in which the pick is neither of the two is told through what each shares with the pick.
        exact = all(item.exact for item in told) if told else all(p.exact for p in plan.pairs if p.rival in pair)
        named += exact
        said += list(plan.lines)
        if count == rigs:
            break
    return count, named, said


def tell(seed: int, outcome: Outcome) -> None:
    """One line for a rig."""
    plan = outcome.plan
    rows = 0 if plan.targets is None else plan.targets.rows
    mark = "alone" if outcome.alone else "NOT"
    before = " / ".join(", ".join(step) for step in outcome.before)
    after = " / ".join(", ".join(step) for step in outcome.after)
    print(
        f"{seed:4d} {outcome.case.fault:<16}{plan.before:6.1f} ->{plan.after:6.1f} sigma {rows:3d} rows {mark:<6}"
        f"[{before}] -> [{after}] {outcome.verdict}",
        flush=True,
    )


def main(arguments: Sequence[str]) -> None:
    """Print both tables."""
    import tempfile

    rigs = int(arguments[0]) if arguments else 50
    exact = int(arguments[1]) if len(arguments) > 1 else 20
    start = int(arguments[2]) if len(arguments) > 2 else 0
    with tempfile.TemporaryDirectory() as folder:
        outcomes, others = by_path(rigs, start, Path(folder))
        good = sum(outcome.alone for outcome in outcomes)
        picked = sum(outcome.before[0][0] == outcome.case.fault for outcome in outcomes)
        print(f"confounded by the path: {len(outcomes)} rigs; the right one named alone: before 0, after {good}")
        print(f"the right one picked first: before {picked}, after "
              f"{sum(bool(o.after) and o.after[0][0] == o.case.fault for o in outcomes)}")  # fmt: skip
        print(f"verdict 'missing' after: {sum(outcome.verdict == 'missing' for outcome in outcomes)}")
        print(f"drawn beside them: {others['alone']} whose path tells the fault alone, {others['exact']} with an exact "
              f"ambiguity beside it, {others['otherwise']} with something else suggested")  # fmt: skip
        print("faults:", dict(Counter(outcome.case.fault for outcome in outcomes)))
        count, named, said = exactly(exact, start, Path(folder)) if exact else (0, 0, [])
        print(f"exact ambiguities: {count} rigs, named as such in {named}")
        for line, times in Counter(said).most_common(8):
            print(f"  {times:3d}  {line}")


if __name__ == "__main__":
    torch.set_num_threads(1)
    main(sys.argv[1:])
