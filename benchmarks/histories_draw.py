"""Histories of machines: a first run, solved as a user would, and a second one after something, or nothing, happened.

Machine, faults, path, noise, load and warmth come from `ptt.rig` and the seed; the second run has its own path, length,
tracker set-up, noise, load and warmth. Only what is said to happen happens to the machine between the two.
"""

import pickle
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from sweep_judge import SAME

from ptt.challenge.cases import Case, draw, names_of, protocols_of
from ptt.challenge.hide import FAULTS, clear_faults, hide_faults
from ptt.challenge.truth import READINGS, reading_noise, table_of, without_set_up
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.telling.floor import noise_floor
from ptt.effects import library
from ptt.effects.registry import make_effect, parse_key
from ptt.judge.history import record
from ptt.judge.ladder.climb import climb
from ptt.machine import format_machine, parse_machine
from ptt.model.entries import read_model
from ptt.model.model import Model
from ptt.rig import simulate
from ptt.rig.draw import PROTOCOLS, DrawnRig
from ptt.rig.draw_foreign import draw_foreign
from ptt.rig.draw_machine import Foreign
from ptt.rig.draw_noise import NOISES
from ptt.rig.schedule import TARGET
from ptt.run.axes import rms_length
from ptt.run.problem import build_problem
from ptt.run.table import Table
from ptt.run.written import write_table

KINDS = ("sound", "drifting", "repaired", "new")
OTHERS = ("homing-slip", "over-compensation", "joint-offset")  # dated, of the controller, or hardly ever told alone
MACHINE = [name for name in names_of("single") if FAULTS[name].section != "tracker" and name not in OTHERS]
SECTIONS = ("controller", "drive", "thermal", "geometry", "structure")
DRIFTS = (1.0, 12.0)  # times the noise of one reading that a drift leaves once the set-up is out
VISIBLE = (2.0, 30.0)
LEAST_ROWS = 60
OWN = 7_000_003  # between the seed of a machine and that of its second run
ATTEMPTS = 40
KEPT = Path("out/histories")


@dataclass(frozen=True)
class History:
    """One machine, twice.

    Attributes:
        seed: of everything.
        kind: what happened in between.
        model: solved on the first run.
        table: the second run.
        drawn: its rig.
        what: fault that drifted, was repaired or is new; '' for nothing.
        parameter: (parameter, leg from 1, true change) of a drift.
        size: of what happened in the second run's readings, times the noise of one reading.
        right_first: whether the first run was solved rightly.
    """

    seed: int
    kind: str
    model: Model
    table: Table
    drawn: DrawnRig
    what: str = ""
    parameter: tuple[str, int, float] | None = None
    size: float = 0.0
    right_first: bool = True


def draw_history(seed: int, kind: str) -> History | None:
    """Draw a history; None where the first run was not solved, as nobody would keep such a model.

    Args:
        seed: of everything.
        kind: of KINDS.

    Returns:
        The history.
    """
    found = first_of(seed)
    if found is None:
        return None
    first, model, right = found
    random = np.random.default_rng([seed, 92, KINDS.index(kind)])
    again = _second(first, seed + 1000 * KINDS.index(kind), random)
    before = history_of(first, again)
    told = {"sound": _sound, "drifting": _drifting, "repaired": _repaired, "new": _new}[kind](
        before, model, random, seed
    )
    if told is None:
        return None
    drawn, what, parameter, size = told
    table = table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent)
    return History(seed, kind, model, table, drawn, what, parameter, size, right)


def first_of(seed: int) -> tuple[DrawnRig, Model, bool] | None:
    """A machine, its model as solved on the first run, and whether rightly; solved ones are kept beside the results."""
    place = KEPT / f"{seed}.pickle"
    if place.exists():
        return pickle.loads(place.read_bytes())
    first = _first(seed, np.random.default_rng([seed, 91]))
    solved = solve(first)
    found = None if solved is None else (first, *solved)
    KEPT.mkdir(parents=True, exist_ok=True)
    place.write_bytes(pickle.dumps(found))
    return found


def solve(drawn: DrawnRig) -> tuple[Model, bool] | None:
    """Solve a run as a user does: diagnose, add what it names, keep the file.

    Returns:
        The model as read from its file, and whether it names what is hidden; None where nothing was named.
    """
    table = table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent)
    problem = build_problem(drawn.rig.machine, table)
    model = Model(drawn.rig.machine)
    found = diagnose(model, problem)
    if found.verdict != "missing":
        return None
    picks = [step[0] for step in found.suggested]
    effects = [make_effect(library(), *parse_key(name)) for name in picks]
    ladder = climb(model, problem.with_noise(noise_floor(model, problem, library())), effects)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.csv"
        write_table(table, path)
        file = record(ladder, "add", [path], date="2026-03-15T10:00:00+00:00")
    return read_model(parse_machine(format_machine(file))), set(picks) == {FAULTS[key].called for key in drawn.truth}


def _first(seed: int, random: np.random.Generator) -> DrawnRig:
    protocol = PROTOCOLS[seed % len(PROTOCOLS)]
    fitting = [name for name in MACHINE if protocol in protocols_of(name)]
    count = int(random.integers(1, 4))
    names = tuple(random.permutation(fitting)[:count].tolist())
    rows = int(np.exp(random.uniform(np.log(LEAST_ROWS), np.log(600))))
    noise = list(NOISES)[seed % len(NOISES)]
    return draw(Case(seed, "multi" if count > 1 else "single", protocol, names, noise, None, rows))[0]


def _second(first: DrawnRig, seed: int, random: np.random.Generator) -> DrawnRig:
    """The same drawing measured anew: other path, length, load, warmth and set-up; the noise of another day."""
    protocols = [name for name in PROTOCOLS if name != "speed" or first.rig.machine.tracker.frame != "measured"]
    protocol = protocols[random.integers(len(protocols))]
    rows = int(np.exp(random.uniform(np.log(LEAST_ROWS), np.log(600))))
    kind = str(random.choice(list(NOISES)))
    again = draw_foreign(
        seed + OWN, protocol, noise=kind, rows=rows, foreign=Foreign(first.rig.machine, first.half_size)
    )
    if first.rig.machine.tracker.sigma_mm is None:
        return again
    # The file states the noise of the tracker: then it is the same tracker.
    kept = {"station_mm", "translation_mm", "rotation_mrad", "frame_scatter_mm", "frame_scatter_mrad", "datum_every"}
    own = again.rig.tracker.model_dump(include=kept) if "station_mm" not in first.notes else {}
    values = first.rig.tracker.model_dump(exclude_defaults=True) | {
        key: value for key, value in own.items() if key != "station_mm"
    }
    tracker = type(again.rig.tracker).model_validate(values)
    return replace(again, rig=replace(again.rig, tracker=tracker))


def history_of(first: DrawnRig, again: DrawnRig) -> DrawnRig:
    """The second run on the first one's machine, faults included."""
    rig = replace(again.rig, **{name: getattr(first.rig, name) for name in SECTIONS})
    return replace(again, rig=rig, truth=first.truth, half_size=first.half_size)


def _sound(drawn: DrawnRig, model: Model, random: np.random.Generator, seed: int) -> Any:
    return drawn, "", None, 0.0


def _drifting(drawn: DrawnRig, model: Model, random: np.random.Generator, seed: int) -> Any:
    """One value of one fault that the model has, drawn until its change is of a size in DRIFTS."""
    noise = _noise(drawn)
    open_ = [key for key in drawn.truth if FAULTS[key].called in model.keys and FAULTS[key].called in SAME]
    for _ in range(ATTEMPTS if open_ else 0):
        key = open_[random.integers(len(open_))]
        name = FAULTS[key].called
        pairs = [(stem, *pair) for stem, pair in SAME[name].items() if pair[0] in drawn.truth[key]]
        if not pairs:
            continue
        stem, own, factor = pairs[random.integers(len(pairs))]
        section = getattr(drawn.rig, FAULTS[key].section)
        values = np.array(np.atleast_1d(getattr(section, own)), dtype=float)
        leg = int(random.integers(len(values)))
        usual = np.abs(values).max()
        step = usual * float(np.exp(random.uniform(np.log(0.03), np.log(2.0)))) * float(random.choice([-1.0, 1.0]))
        if values[leg] + step < 0.0 <= values[leg] and name not in ("homing-offset", "lead-scale", "link-length",
                                                                   "tower-position", "tower-tilt", "platform-twist",
                                                                   "column-bend"):  # fmt: skip
            step = abs(step)
        values[leg] += step
        put = float(values[0]) if np.ndim(getattr(section, own)) == 0 else tuple(values.tolist())
        rig = replace(drawn.rig, **{FAULTS[key].section: section.model_copy(update={own: put})})
        changed = replace(drawn, rig=rig)
        size = _apart(changed, drawn) / noise
        if DRIFTS[0] <= size <= DRIFTS[1]:
            return changed, name, (stem, leg + 1 if len(values) > 1 else 0, step * factor), size
    return None


def _repaired(drawn: DrawnRig, model: Model, random: np.random.Generator, seed: int) -> Any:
    noise = _noise(drawn)
    for key in random.permutation([key for key in drawn.truth if FAULTS[key].called in model.keys]).tolist():
        cured = replace(drawn, rig=clear_faults(drawn.rig, drawn.truth, [key]))
        size = _apart(cured, drawn) / noise
        if size >= VISIBLE[0]:
            return cured, FAULTS[key].called, None, size
    return None


def _new(drawn: DrawnRig, model: Model, random: np.random.Generator, seed: int) -> Any:
    """Another fault, of the library or outside it."""
    noise, taken = _noise(drawn), {FAULTS[key].called for key in drawn.truth} | set(model.keys)
    outside = random.random() < 0.5
    names = names_of("unknown", "shown") if outside else MACHINE
    fitting = [n for n in names if drawn.protocol in protocols_of(n) and FAULTS[n].called not in taken]
    for attempt, name in enumerate(random.permutation(fitting).tolist()):
        more = hide_faults(drawn, [name], seed + 31 * attempt)
        size = _apart(more, drawn) / noise
        if VISIBLE[0] <= size <= VISIBLE[1]:
            return more, name, None, size
    return None


def _noise(drawn: DrawnRig) -> float:
    still = simulate(drawn.rig, drawn.targets, noise=False)
    return reading_noise(drawn.rig, still.truth).total


def _apart(one: DrawnRig, other: DrawnRig) -> float:
    """What two rigs on the same run differ by once the set-up is out, mm."""
    frames = [simulate(item.rig, item.targets, noise=False).frame for item in (one, other)]
    shift = frames[0][READINGS].to_numpy(float) - frames[1][READINGS].to_numpy(float)
    read = np.isfinite(shift).all(axis=1) & (frames[0]["role"] != "base").to_numpy()
    place, run = frames[0][TARGET].to_numpy(float), frames[0]["run"].to_numpy()
    return rms_length(without_set_up(one.rig, shift[read], place[read], run[read]))
