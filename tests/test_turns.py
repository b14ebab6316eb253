"""Reversals shorter than any that was measured: play that nobody saw being taken up is no promise there."""

import itertools
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import torch
from told_models import with_effects

from ptt.correct.compensate import compensate
from ptt.diagnosis.diagnose import diagnose
from ptt.door.tally import tally
from ptt.effects import library
from ptt.effects.layout import sizes
from ptt.errors import ModelError
from ptt.fitting.kept import keep_covariance, kept_covariance
from ptt.fitting.turns import like_play, unturned
from ptt.judge.history import record
from ptt.judge.ladder.climb import climb
from ptt.judge.ladder.ladder import Ladder
from ptt.machine import MachineFile, format_machine, load_machine, parse_machine
from ptt.machine_schema import EffectEntry, ParameterEntry
from ptt.mechanisms import build_mechanism
from ptt.model.chain import linearise, predict
from ptt.model.entries import read_model
from ptt.model.model import Model
from ptt.rig import parse_rig, simulate
from ptt.rig.simulate import write_run
from ptt.run.noise import Noise
from ptt.run.problem import build_problem
from ptt.run.reading import read_table
from ptt.run.table import make_table
from ptt.run.viewing import build_view

DATA = Path(__file__).resolve().parents[1] / "data"
DRAWN = load_machine(DATA / "machine.toml")
FILE = replace(DRAWN, tracker=DRAWN.tracker.model_copy(update={"frame": "trusted"}), text="")
GAP = 0.06


def far(count: int = 160) -> np.ndarray:
    """Poses far apart: no slider has gone less than some millimetres behind its last reversal."""
    drawn, kept = np.random.default_rng(5), [np.zeros(3)]
    mechanism = build_mechanism(FILE.machine)
    while len(kept) < count:
        place = drawn.uniform(-80.0, 80.0, 3).round(3)
        q = mechanism.inverse(torch.tensor(np.array([kept[-1], place])))
        if float((q[1] - q[0]).abs().min()) > 15.0:
            kept.append(place)
    return np.array(kept)


def near() -> np.ndarray:
    """The same with a short way back and forth behind each pose."""
    steps = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.15], [0.0, 0.0, -0.2], [0.0, 0.0, 0.4], [0.0, 0.0, -0.7]])
    return (far(60)[:, None] + np.cumsum(steps, axis=0)).reshape(-1, 3)


def ladder_of(places: np.ndarray, folder: Path) -> tuple[Ladder, Path]:
    """A machine with play, measured at places, its play added to the model."""
    machine = FILE.machine.model_dump(mode="json", exclude_none=True)
    rig = parse_rig(
        {"machine": machine, "seed": 3, "drive": {"backlash_mm": [GAP] * 3}, "tracker": {"white_mm": 0.004}}
    )
    run = simulate(rig, pd.DataFrame(places, columns=["x_cmd", "y_cmd", "z_cmd"]))
    write_run(run.frame, folder / "run.csv")
    problem = build_problem(FILE, read_table(folder / "run.csv"))
    return climb(Model(FILE), problem, [library()["backlash"]()]), folder / "run.csv"


def solved(places: np.ndarray, folder: Path) -> MachineFile:
    """Its model, as a file keeps it."""
    ladder, run = ladder_of(places, folder)
    return parse_machine(format_machine(record(ladder, "ptt add", [run])))


@pytest.fixture(scope="module")
def both(tmp_path_factory) -> tuple[MachineFile, MachineFile]:
    return solved(far(), tmp_path_factory.mktemp("far")), solved(near(), tmp_path_factory.mktemp("near"))


def test_a_run_knows_how_soon_play_is_taken_up_where_it_went_back_a_little(both) -> None:
    from_far, from_near = (kept_covariance(read_model(file)).turns for file in both)
    assert min(from_far) > 1.0 and max(from_near) < 0.3


def test_what_no_reading_near_a_reversal_tells_is_said(tmp_path) -> None:
    def said(places: np.ndarray) -> list[str]:
        folder = tmp_path / str(len(places))
        folder.mkdir()
        return [item.text for item in ladder_of(places, folder)[0].report.unobservable if item.effect == "backlash"]

    assert said(near()) == []
    (line,) = said(far())
    assert "whether play of sliders 1, 2 and 3 is taken up at once cannot be told from a wind-up over 4.7 mm" in line


def test_commands_that_go_back_by_less_than_was_measured_are_uncertain(both) -> None:
    there = np.array([[30.0, 10.0, 5.0], [30.0, 10.0, 25.0], [30.0, 10.0, 24.9], [30.0, 10.0, 4.0], [30.0, 10.0, 30.0]])
    from_far, from_near = (compensate(read_model(file), make_table(there)) for file in both)
    assert from_far.status.tolist() == ["ok", "ok", "uncertain", "ok", "ok"]
    assert 0.5 * GAP < from_far.sigma[2] < 3.0 * GAP and from_far.sigma[[0, 1, 3, 4]].max() < 0.1 * GAP
    assert (from_near.status == "ok").all() and from_near.sigma.max() < 0.1 * GAP


def test_a_file_that_keeps_no_turns_promises_as_without(both) -> None:
    without = replace(both[0], covariance=both[0].covariance.model_copy(update={"turns": ()}))
    assert "turns" not in format_machine(replace(without, text="")) and "turns" in format_machine(both[0])
    there = np.array([[30.0, 10.0, 25.0], [30.0, 10.0, 25.1], [30.0, 10.0, 25.0]])
    assert compensate(read_model(without), make_table(there)).sigma.max() < 0.1 * GAP


def test_what_a_controller_adds_comes_at_once(both) -> None:
    model = read_model(both[0])
    terms = [
        (t.effect, t.theta * torch.tensor([-1.0, -1.0, -1.0, 1.0])) for t in model.terms if t.effect.name == "backlash"
    ]
    problem = build_problem(both[0], make_table(near()).replace(measured=near()))
    jacobian = linearise(terms, problem.view).jacobian
    assert jacobian.shape[2] == sum(sum(sizes(effect, 3)) for effect, _ in terms)
    assert not unturned(terms, problem.view, jacobian, torch.full((3,), 2.0, dtype=torch.float64)).any()


SMALL = np.array([30.0, 10.0, 5.0]) + np.cumsum(np.random.default_rng(2).normal(0.0, 0.15, (40, 3)), axis=0)


def wound_up(length: float) -> Model:
    values = {"height_mm": ParameterEntry(value=(0.03,) * 3, std=0.0), "length_mm": ParameterEntry(value=(length,) * 3)}
    model = read_model(replace(FILE, effect=(EffectEntry(name="windup", parameters=values),)))
    layout = SimpleNamespace(lasting={"windup height_mm 1": 0})
    told = {"unknowns": np.zeros(1), "covariance": np.full((1, 1), 1e-8), "unnamed": None, "doubt": None, "turns": ()}
    spec = keep_covariance(SimpleNamespace(model=model, layout=layout, **told), heldout=0.005)
    return read_model(replace(model.file, covariance=spec))


def test_small_steps_hang_on_from_which_side_the_joints_came() -> None:
    model = wound_up(8.0)
    unsaid = compensate(model, make_table(SMALL))
    assert unsaid.status[0] == "ok" and (unsaid.status[1:10] == "uncertain").all()
    said = np.full((40, 3), np.nan)
    said[0] = 1.0
    stated = compensate(model, make_table(SMALL, direction=said))
    assert (stated.status == "ok").all() and not stated.approach.any()
    far_apart = compensate(wound_up(0.5), make_table(far(20)))
    assert (far_apart.status == "ok").all()


def test_where_a_joint_went_past_a_row_it_hangs_on_how_far() -> None:
    place = far(20)
    shown = build_view(FILE, make_table(place)).direction.numpy()
    shown[0] = 1.0
    straight = compensate(wound_up(4.0), make_table(place, direction=shown))
    assert not straight.approach.any()
    other = shown.copy()
    other[10] *= -1.0
    past = compensate(wound_up(4.0), make_table(place, direction=other))
    assert past.status[10] == "uncertain" and not past.approach[:10].any()
    short = compensate(wound_up(0.05), make_table(place, direction=other))  # wound up within what is assumed
    assert short.status[10] == "ok"


def test_what_hangs_on_the_way_to_the_first_row_is_said() -> None:
    table = make_table(SMALL)
    counted = tally(table, compensate(wound_up(8.0), table))
    (line,) = (line for line in counted.warnings("t.csv", network=False) if "uncertain" in line)
    assert "the side from which joints come to the first row" in line and "dir1.." in line
    assert "matters and is not stated" in line
    assert (
        counted.approached == counted.status["uncertain"] and (counted + counted).approached == 2 * counted.approached
    )


def test_a_diagnosis_says_what_play_may_be_as_well(tmp_path) -> None:
    words = []
    for places in (far(), near()):
        folder = tmp_path / str(len(places))
        folder.mkdir()
        _, run = ladder_of(places, folder)
        found = diagnose(Model(FILE), build_problem(FILE, read_table(run)))
        assert found.suggested[0][0] == "backlash"
        words.append(found.candidates[0].words)
    assert "except wind-up that is complete within 4.7 mm of a reversal, where no reading was taken" in words[0]
    assert "wind-up" not in words[1]


@pytest.mark.parametrize(("places", "said"), [(far, "play of sliders 1, 2 and 3 that is taken up at once"), (near, "")])
def test_a_wind_up_that_no_reading_shows_on_the_way_may_be_play(places, said: str) -> None:
    target = places()
    problem = build_problem(FILE, make_table(target, measured=target))
    (term,) = wound_up(0.4).terms
    noise = Noise(np.eye(3) * 0.003**2, "machine file")
    fitted = SimpleNamespace(noise=noise, outliers=~problem.used, model=SimpleNamespace(file=FILE))
    assert like_play(fitted, term, problem) == said


def test_a_gap_that_no_move_takes_up_is_known_to_be_no_smaller_and_no_more(tmp_path) -> None:
    """Up, and once down by less than the gap: any larger one would read the same."""
    up = np.column_stack([np.zeros(60), np.zeros(60), np.linspace(-40.0, 40.0, 60)])
    up[30:, 2] -= 1.365  # 9 um below the row before
    ladder, _ = ladder_of(up, tmp_path)
    assert 0.0 < up[29, 2] - up[30, 2] < 0.2 * GAP
    (term,) = (term for term in ladder.model.terms if term.effect.name == "backlash")
    assert not term.measured[:3].any()
    taken, _ = ladder_of(near(), tmp_path)
    (term,) = (term for term in taken.model.terms if term.effect.name == "backlash")
    assert term.measured[:3].all() and float(term.std[:3].max()) < 0.01


def test_each_joint_may_have_come_from_the_other_side_by_itself() -> None:
    model = wound_up(8.0)
    sent = compensate(model, make_table(SMALL))
    terms = [(term.effect, term.theta) for term in model.terms]

    def tool(sides: np.ndarray | None) -> np.ndarray:
        direction = np.full((40, 3), np.nan)
        if sides is not None:
            direction[0] = sides
        table = make_table(SMALL, command=sent.q, direction=None if sides is None else direction)
        return predict(terms, build_view(FILE, table)).p.numpy()

    usual = build_view(FILE, make_table(SMALL, command=sent.q)).direction[0].numpy()
    flips = np.array(list(itertools.product((1.0, -1.0), repeat=3)))
    off = np.array([np.linalg.norm(tool(usual * flip) - tool(None), axis=1) for flip in flips])
    rms = np.sqrt(np.square(off).mean(axis=0))
    assert rms[1:6].min() > 0.01
    np.testing.assert_allclose(sent.approach[1:6], rms[1:6], rtol=0.1)


def test_a_height_below_nothing_is_refused_as_a_length_is() -> None:
    for height, length in ((-0.03, 1.0), (0.03, 0.0)):
        with pytest.raises(ModelError, match="is out of its bounds"):
            with_effects(FILE, windup={"height_mm": (height,) * 3, "length_mm": (length,) * 3})
