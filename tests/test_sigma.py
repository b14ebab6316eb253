"""What a fit leaves uncertain at a target: kept in the file, right in size, and a status where it is too much."""

from dataclasses import replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from nets import GaussianRbf
from ptt.correct.commands import STATUSES
from ptt.correct.compensate import NetworkError, compensate
from ptt.correct.doubt import doubtful
from ptt.correct.training.compensator import Compensator
from ptt.door.predicting import predict
from ptt.door.tally import Tally
from ptt.effects.registry import library, make_effect
from ptt.fitting.kept import keep_covariance, kept_covariance, why_not_kept
from ptt.judge.history import record
from ptt.judge.ladder.climb import climb
from ptt.judge.ladder.ladder import Ladder
from ptt.machine import MachineFile, format_machine, load_machine, parse_machine, save_machine
from ptt.machine_schema import EffectEntry, MaskedSpec, ParameterEntry, TrackerSpec
from ptt.model.entries import read_model
from ptt.model.model import Model
from ptt.rig import parse_rig, simulate, write_run
from ptt.run.problem import build_problem
from ptt.run.reading import read_table
from ptt.run.table import make_table

DATA = Path(__file__).resolve().parents[1] / "data"
SIGMA = 0.004
FILE = replace(load_machine(DATA / "machine.toml"), text="", tracker=TrackerSpec(sigma_mm=SIGMA))
DRIVE = {"homing_mm": [0.3, -0.2, 0.1], "scale_um_per_m": [80.0, -60.0, 40.0]}
EFFECTS = ("homing-offset", "lead-scale", "link-length")


def path_of(place: np.ndarray) -> pd.DataFrame:
    return pd.DataFrame(place, columns=["x_cmd", "y_cmd", "z_cmd"])


def learn(
    folder: Path, place: np.ndarray, drive: dict, effects: tuple[str, ...], file: MachineFile = FILE, seed: int = 1
):
    """The rig's run of some targets, what is fitted to it, and the model as a file keeps it."""
    rig = parse_rig({"machine": FILE.machine.model_dump(), "seed": 3, "drive": drive})
    truth = simulate(rig, path_of(place), noise=False).frame
    names = ["x_meas", "y_meas", "z_meas"]
    truth[names] += np.random.default_rng(seed).normal(0.0, SIGMA, (len(truth), 3))
    write_run(truth, folder / "run.csv")
    problem = build_problem(file, read_table(folder / "run.csv"))
    ladder = climb(Model(file), problem, [make_effect(library(), name) for name in effects])
    model = read_model(parse_machine(format_machine(record(ladder, "add", [folder / "run.csv"]))))
    return rig, problem, ladder, model


def went(rig, place: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Where the rig's tool really is, (n, 3) mm."""
    return simulate(rig, path_of(place), sliders=pd.DataFrame(q, columns=["b1", "b2", "b3"]), noise=False).truth


def shown(problem, ladder: Ladder, place: np.ndarray) -> np.ndarray:
    """Where the fitted tracker frame shows places of the base frame, (n, 3) mm."""
    fitted = ladder.steps[-1].fitted
    motion = fitted.values[-6:] if fitted.layout.frames else np.zeros(6)
    moved = place + motion[:3] + np.cross(motion[3:], place)
    return moved @ problem.rotation[0].T + problem.shift[0]


@pytest.mark.parametrize("frame", [pytest.param("trusted", marks=pytest.mark.long), "fitted"])
def test_errors_of_the_rig_are_as_large_as_stated(tmp_path, frame):
    """Eight noises, targets inside and outside the measured volume: the error over sigma scatters about one."""
    file = replace(FILE, tracker=TrackerSpec(frame=frame, sigma_mm=SIGMA))
    random = np.random.default_rng(2)
    measured, wanted = (random.uniform(-half, half, (30, 3)).round(4) for half in (30.0, 60.0))
    pulls = []
    for seed in range(8):
        rig, problem, ladder, model = learn(tmp_path, measured, DRIVE, EFFECTS, file, seed)
        commands = compensate(model, make_table(wanted))
        assert (commands.sigma > 0.0).all()
        error = went(rig, wanted, commands.q) - shown(problem, ladder, wanted)
        pulls.append(np.square(error).sum(axis=1) / commands.sigma**2)
        spread = commands.sigma
    assert 0.3 < np.mean(pulls) < 1.5  # rather too wide than too narrow
    far = np.linalg.norm(wanted, axis=1)
    assert spread[far > 70].mean() > 2.0 * spread[far < 30].mean()  # what is far from the readings is known less


def test_commands_between_the_heights_of_a_raster_are_uncertain(tmp_path):
    """32 poses at two heights tell nothing of a screw between them, however small the held-out error is."""
    height = np.arange(150.0, 421.0, 15.0)
    curve = np.random.default_rng(1).normal(0.0, 80.0, (3, len(height))).round(1)
    drive = {"map_height_mm": height.tolist(), "map_um": curve.tolist()}
    side = [-12.0, -4.0, 4.0, 12.0]
    place = {z: np.array(list(product(side, side, [z]))) for z in (-30.0, 0.0, 30.0)}
    grid = np.concatenate([place[-30.0], place[30.0]])
    rig, problem, ladder, model = learn(tmp_path, grid, drive, ("screw-error-map",))
    on, between = (compensate(model, make_table(wanted)) for wanted in (grid, place[0.0]))
    error = [
        1e3 * np.linalg.norm(went(rig, wanted, commands.q) - shown(problem, ladder, wanted), axis=1).mean()
        for wanted, commands in ((grid, on), (place[0.0], between))
    ]
    assert ladder.steps[-1].heldout_rms_um["total"] < 30.0 and error[0] < 20.0 and error[1] > 60.0
    assert on.counts["ok"] == len(grid) and between.counts["uncertain"] == len(place[0.0])
    assert between.sent.all() and np.isfinite(between.q).all()  # sent, and said


def test_commands_beyond_the_heights_of_a_run_are_as_uncertain_as_they_are_wrong(tmp_path):
    """A curve is held beyond its end, and the screw is not."""
    height = np.arange(150.0, 421.0, 15.0)
    random, pulls = np.random.default_rng(6), []
    for seed in range(3):
        drive = {"map_height_mm": height.tolist(), "map_um": bent(height, seed).tolist()}
        inside, beyond = (random.uniform(-1.0, 1.0, (80, 3)) * [15.0, 15.0, half] for half in (30.0, 60.0))
        beyond = beyond[np.abs(beyond[:, 2]) > 45.0].round(4)
        rig, problem, ladder, model = learn(tmp_path, inside.round(4), drive, ("screw-error-map",))
        commands = compensate(model, make_table(beyond))
        assert commands.counts["uncertain"] == len(beyond)
        error = went(rig, beyond, commands.q) - shown(problem, ladder, beyond)
        pulls.append(np.square(error).sum(axis=1) / commands.sigma**2)
    assert 0.1 < np.concatenate(pulls).mean() < 2.0


def bent(height: np.ndarray, seed: int) -> np.ndarray:
    """Screws with a level, a slope and a bow of their own, in um: what a usual curve looks like on a short travel."""
    place = (height - height.mean()) / np.ptp(height)
    level, slope, bow = np.random.default_rng(seed).normal(0.0, (60.0, 300.0, 60.0), (3, 3)).T[..., None]
    return np.asarray((level + slope * place + bow * np.cos(2 * np.pi * place)).round(2))


@pytest.mark.parametrize(
    ("frame", "partners"),
    [
        pytest.param("trusted", (), id="trusted-alone", marks=pytest.mark.long),
        pytest.param("trusted", ("homing-offset", "lead-scale"), id="trusted-beside homing and lead"),
        pytest.param("fitted", (), id="fitted-alone"),
        pytest.param(
            "fitted", ("homing-offset", "lead-scale"), id="fitted-beside homing and lead", marks=pytest.mark.long
        ),
    ],
)
def test_a_smooth_screw_is_corrected_between_the_heights_of_a_raster(tmp_path, frame, partners):
    """Without homing and lead in the model the curve must not bend between the heights to imitate them."""
    file = replace(FILE, tracker=TrackerSpec(frame=frame, sigma_mm=SIGMA))
    height = np.arange(150.0, 421.0, 15.0)
    side = [-12.0, -4.0, 4.0, 12.0]
    grid, between = (np.array(list(product(side, side, z))) for z in ([-30.0, 30.0], [-20.0, -10.0, 0.0, 10.0, 20.0]))
    before, after = [], []
    for seed in range(3):
        drive = {"map_height_mm": height.tolist(), "map_um": bent(height, seed).tolist()}
        rig, problem, ladder, model = learn(tmp_path, grid, drive, (*partners, "screw-error-map"), file)
        corrected, bare = compensate(model, make_table(between)), compensate(Model(file), make_table(between))
        aim = shown(problem, ladder, between)
        before.append(1e3 * np.linalg.norm(went(rig, between, bare.q) - aim, axis=1).mean())
        after.append(1e3 * np.linalg.norm(went(rig, between, corrected.q) - aim, axis=1).mean())
    assert max(before) > 50.0
    assert max(after) < 15.0 and (np.array(after) < before).all()


def test_what_is_kept_reads_back_and_belongs_to_its_values(tmp_path):
    place = np.random.default_rng(4).uniform(-50, 50, (60, 3)).round(4)
    _, _, ladder, model = learn(tmp_path, place, DRIVE, EFFECTS)
    kept, fitted = kept_covariance(model), ladder.steps[-1].fitted
    assert kept is not None and kept.heldout == pytest.approx(1e-3 * ladder.steps[-1].heldout_rms_um["total"])
    back = dict(zip(kept.names, np.sqrt(np.square(kept.root).sum(axis=1)), strict=True))
    np.testing.assert_allclose(
        [back[name] for name in fitted.layout.names], np.sqrt(np.diag(fitted.covariance)), rtol=1e-4
    )
    text = format_machine(model.file)
    assert format_machine(parse_machine(text)) == text
    first, *others = model.file.effect
    edited = {"offset_mm": first.parameters["offset_mm"].model_copy(update={"value": 0.4})}
    other = read_model(replace(model.file, effect=(first.model_copy(update={"parameters": edited}), *others)))
    assert kept_covariance(other) is None and "belongs to other values" in why_not_kept(other)
    assert why_not_kept(model) == why_not_kept(read_model(replace(other.file, covariance=None))) == ""
    commands = compensate(other, make_table(place))
    assert np.isnan(commands.sigma).all() and (commands.status == "ok").all()


def test_what_is_kept_belongs_to_its_drawing(tmp_path):
    place = np.random.default_rng(4).uniform(-50, 50, (60, 3)).round(4)
    _, _, _, model = learn(tmp_path, place, DRIVE, EFFECTS)
    spec, file = model.file.machine, model.file

    def drawn(**changes: object) -> Model:
        return read_model(replace(file, machine=spec.model_copy(update=changes)))

    longer = drawn(link_length_mm=spec.link_length_mm + 1.0)
    assert kept_covariance(longer) is None and "belongs to another drawing" in why_not_kept(longer)
    assert np.isnan(compensate(longer, make_table(place)).sigma).all()
    for same in (drawn(name="another"), drawn(slider_travel_mm=((160.0, 400.0),) * 3)):
        assert kept_covariance(same) is not None and why_not_kept(same) == ""


def test_a_network_is_sure_within_its_domain_only():
    wanted = np.random.default_rng(0).uniform(-40, 40, (50, 3))
    commands = compensate(
        read_model(FILE), make_table(wanted), correction=lambda p, _: p + 0.1, inside=lambda p, _: p[:, 0] > 0.0,
        network=NetworkError(inside=0.008, outside=0.14),
    )  # fmt: skip
    np.testing.assert_array_equal(commands.status == "uncertain", wanted[:, 0] <= 0.0)
    np.testing.assert_allclose(commands.sigma, np.where(wanted[:, 0] > 0.0, 0.008, 0.14))


def test_parameters_beside_a_network_leave_a_command_sure_where_they_are(tmp_path):
    place = np.random.default_rng(4).uniform(-50, 50, (60, 3)).round(4)
    *_, model = learn(tmp_path, place, DRIVE, EFFECTS)
    far = np.concatenate([place[:20], place[:20] + np.array([90.0, 0.0, 0.0])])
    bare = compensate(model, make_table(far))
    promised = 1.5 * float(bare.sigma[:20].max())
    assert bare.sigma[20:].max() > promised  # there they say less than the network promises
    network = NetworkError(inside=promised, outside=promised)  # as of one that found nothing to learn
    both = compensate(
        model, make_table(far), correction=lambda p, _: p, inside=lambda p, _: p[:, 0] < np.inf, network=network
    )
    np.testing.assert_array_equal(both.status == "uncertain", bare.sigma > promised)
    np.testing.assert_allclose(both.sigma, np.maximum(bare.sigma, promised))


def test_where_nothing_is_promised_a_command_must_correct_more_than_is_uncertain():
    sigma, shift = np.array([0.01, 0.2, np.nan]), np.array([0.1, 0.1, 0.1])
    np.testing.assert_array_equal(doubtful(sigma, shift, None), [False, True, False])
    np.testing.assert_array_equal(doubtful(sigma, shift, 0.005), [True, True, False])


def test_a_long_list_is_worked_out_in_parts_with_the_same_uncertainty(tmp_path, monkeypatch):
    """Play remembers the travel: each part has to be entered as the whole list enters it."""
    random = np.random.default_rng(4)
    measured, wanted = random.uniform(-30.0, 30.0, (40, 3)).round(4), random.uniform(-50.0, 50.0, (100, 3))
    wanted[30:45, 0] = np.linspace(0.0, 0.02, 15)  # moves within the play
    wanted[30:45, 1:] = 0.0
    model = learn(tmp_path, measured, {"backlash_mm": [0.05, 0.03, 0.04]}, ("backlash", "homing-offset"))[3]
    whole = compensate(model, make_table(wanted)).sigma
    monkeypatch.setattr("ptt.fitting.tool_sigma.CHUNK", 17)
    parts = compensate(model, make_table(wanted)).sigma
    np.testing.assert_allclose(parts, whole, rtol=1e-9)
    assert np.ptp(whole) > 0.0


def test_a_model_that_predicts_no_better_than_the_drawing_is_sure_of_no_command(tmp_path: Path) -> None:
    """A sound machine with a curve fitted to its noise: whatever is sent instead of the drawing's is a guess."""
    place = np.random.default_rng(4).uniform(-50.0, 50.0, (40, 3)).round(3)
    targets = make_table(target=place)
    for drive, effect, status in (({}, "guide-straightness", "uncertain"), (DRIVE, "homing-offset", "ok")):
        _, _, ladder, model = learn(tmp_path, place, drive, (effect,))
        assert ladder.steps[1].helped == (status == "ok")
        assert set(compensate(model, targets).status) == {status}


@pytest.mark.parametrize(
    ("unsure", "missed", "why"),
    [
        (10, 0.0, "no command is certain: the model predicts held-out readings no better than the drawing does"),
        (3, 0.0, "measure near them"),
        (10, 0.02, "less certain there than the held-out error says"),
    ],
)
def test_why_commands_are_uncertain_is_said_as_far_as_it_is_known(unsure, missed, why):
    status = {name: 0 for name in STATUSES} | {"ok": 10 - unsure, "uncertain": unsure}
    first = {name: (2,) if count else () for name, count in status.items()}
    tally = Tally(10, status, first, 10, 0.0, 0.1, 0.01, missed, 0.0, "nobody")
    assert why in tally.warnings("t.csv", network=False)[0]


@pytest.mark.parametrize("part", [{"root": "eNpj"}, {"of": ("homing-offset offset_mm 1",)}])
def test_a_damaged_covariance_is_said(part, tmp_path):
    effect = EffectEntry(name="homing-offset", parameters={"offset_mm": ParameterEntry(value=0.2)})
    model, names = read_model(replace(FILE, effect=(effect,))), tuple(f"homing-offset offset_mm {i}" for i in (1, 2, 3))
    layout = SimpleNamespace(lasting={name: place for place, name in enumerate(names)})
    told = {"unknowns": np.zeros(3), "covariance": np.eye(3), "unnamed": None, "doubt": None, "turns": ()}
    spec = keep_covariance(SimpleNamespace(model=model, layout=layout, **told))
    model = replace(model, file=replace(model.file, covariance=spec))
    assert why_not_kept(model) == ""
    damaged = replace(model, file=replace(model.file, covariance=spec.model_copy(update=part)))
    assert "[covariance] is damaged" in why_not_kept(damaged)
    lost = spec.model_copy(update={"unnamed": MaskedSpec(of=("link-length",), told="eNpj")})
    assert "unnamed] cannot be read" in why_not_kept(replace(model, file=replace(model.file, covariance=lost)))
    save_machine(damaged.file, tmp_path / "m.toml")
    (line,) = predict(tmp_path / "m.toml", np.zeros((2, 3))).warnings
    assert line.startswith(f"{tmp_path / 'm.toml'} [covariance] is damaged")


def test_beside_a_network_that_learned_nothing_a_command_is_as_sure_as_the_physics():
    held, network = {"physics": {"total": 9.0}, "rbf": {"total": 8.0}}, GaussianRbf.__new__(GaussianRbf)
    for learned, error in ((True, NetworkError(1e-3 * 8.0, 1e-3 * 9.0)), (False, None)):
        notes = {"heldout_rms_um": held, "rbf": {"learned": [False, learned, False]}}
        assert Compensator(read_model(FILE), network, notes).error == error
