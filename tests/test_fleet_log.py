"""A log that is read part by part: the same as the whole, and what the virtual machine was given comes back."""

from dataclasses import replace
from pathlib import Path

import duckdb
import numpy as np
import pytest
import torch
from test_fleet_store import MACHINE

from ptt.effects.registry import library, make_effect
from ptt.errors import InputError, ModelError, SetupError
from ptt.fitting.layout import lay_out
from ptt.fitting.whitened import build_whitened
from ptt.fleet import log as logs
from ptt.fleet.fit_log import fit_file, fit_log
from ptt.fleet.log import enter_part, hand_on, open_log, read_log, read_part
from ptt.fleet.log_copy import to_parquet
from ptt.fleet.shares import Passes, buckets_of
from ptt.fleet.sound import require_sound
from ptt.machine import load_machine
from ptt.mechanisms import build_mechanism
from ptt.model.entries import read_model
from ptt.model.model import Model, Term
from ptt.rig import parse_rig, simulate, write_run
from ptt.rig.nominal import ideal_machine
from ptt.rig.targets import make_volume
from ptt.run.base_frame import into_base
from ptt.run.noise import Noise
from ptt.run.problem import build_problem
from ptt.run.reading import read_table
from ptt.run.table import make_table, take_rows
from ptt.run.viewing import elapsed
from ptt.run.written import table_to_frame

THREE = 3


def made(rows: int):
    """A smooth way with turns, read on the move; slider 3 stands for longer than any part, and then goes on."""
    random = np.random.default_rng(2)
    at = np.arange(rows) / 9.0
    way = 283.0 + 40.0 * np.stack([np.sin(at), np.cos(0.7 * at), np.sin(0.31 * at)], axis=1)
    third, stands = way[:, 2].copy(), slice(rows // 3, 2 * rows // 3)
    third[stands] = third[stands.start]
    third[stands.stop :] -= third[stands.stop] - third[stands.start] + 0.5
    way[:, 2] = third
    place = build_mechanism(load_machine(MACHINE).machine).forward(torch.as_tensor(way)).numpy()
    read = place + 0.02 * np.sin(at)[:, None] + 0.005 * random.normal(size=place.shape)
    return make_table(place, way, read, time_s=np.arange(rows) * 0.1, temp_c=20.0 + at / 50.0)


def write_log(path: Path, rows: int) -> Path:
    """Its Parquet, written by DuckDB from the columns of a tracker CSV."""
    frame = table_to_frame(made(rows))
    connection = duckdb.connect()
    connection.register("rows", frame)
    connection.execute(f"COPY rows TO '{path}' (FORMAT parquet)")
    return path


def terms_of(*names: str) -> list[Term]:
    """Effects at zero, or in the middle of what is searched."""
    terms = []
    for name in names:
        effect = make_effect(library(), name)
        own = [parameter.on("three-ptt") for parameter in effect.parameters]
        theta = [each.usual if each.role != "linear" else 0.0 for each in own for _ in range(each.size(THREE))]
        terms.append(Term(effect, torch.tensor(theta, dtype=torch.float64)))
    return terms


def test_parts_say_what_the_whole_says_also_of_memory_speed_and_a_slider_that_stands(tmp_path, monkeypatch):
    monkeypatch.setattr(logs, "NEIGHBOUR_ROWS", 40)
    machine, path = load_machine(MACHINE), write_log(tmp_path / "log.parquet", 900)
    log = open_log(machine, path, 130)
    terms = terms_of("backlash", "windup", "following-error", "screw-growth", "tracker-drift")
    layout, noise = lay_out(Model(machine), log.whole, terms), Noise(np.eye(3) * 0.005**2, "stated")
    unknowns = np.random.default_rng(1).uniform(0.5, 1.0, len(layout.scale))
    share = Passes(log, layout, noise)(unknowns, np.zeros(0, int))
    problem = build_problem(machine, made(900))
    read = into_base(problem.table.measured, problem.frame, log.whole.rotation, log.whole.shift)
    whole = build_whitened(layout, replace(problem, measured=read), noise.whitener, unknowns)
    for one, other in zip(share.total, whole.sums(problem.used), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


@pytest.mark.parametrize("empty", [False, True])
def test_a_clock_that_is_set_back_goes_on_from_part_to_part_as_in_a_run(empty: bool, tmp_path):
    machine, path, table = load_machine(MACHINE), tmp_path / "log.parquet", made(300)
    clock = (
        np.asarray(table.time_s) - np.where(np.arange(300) >= 110, 9.0, 0.0) - np.where(np.arange(300) > 220, 5.0, 0)
    )
    frame = table_to_frame(table).assign(time_s=clock)
    if empty:
        frame.loc[[100, 101, 110, 150], "time_s"] = np.nan
    connection = duckdb.connect()
    connection.register("rows", frame)
    connection.execute(f"COPY rows TO '{path}' (FORMAT parquet)")
    log, parts, state = open_log(machine, path, 100), [], None
    for part in log.parts:
        rows = read_part(log, part)
        parts.append(enter_part(rows, part, state).view.time.numpy())
        state = hand_on(rows, part, state)
    told = frame["time_s"].notna().to_numpy()
    whole = elapsed(take_rows(table.replace(time_s=clock), np.flatnonzero(told)))
    np.testing.assert_allclose(np.concatenate(parts)[told], whole, atol=1e-9)


def test_a_part_with_a_pause_knows_no_beginning_but_that_of_its_log(tmp_path):
    """A part's own clock would put it at another time than the rows have."""
    machine, path, table = load_machine(MACHINE), tmp_path / "log.parquet", made(300)
    clock = np.asarray(table.time_s) + np.where(np.arange(300) >= 250, 7200.0, 0.0)
    connection = duckdb.connect()
    connection.register("rows", table_to_frame(table).assign(time_s=clock))
    connection.execute(f"COPY rows TO '{path}' (FORMAT parquet)")
    log = open_log(machine, path, 100)
    for view in (log.whole.view, *(read_part(log, part).view for part in log.parts)):
        assert view.beginnings == (0.0,)


def test_readings_of_a_pose_fall_into_one_bucket_where_its_target_is_written_to_the_micron():
    random = np.random.default_rng(4)
    place = np.round(random.uniform(-80.0, 80.0, (2000, 3)), 3)
    bucket = buckets_of(place)
    assert (buckets_of(place + random.uniform(-4e-4, 4e-4, place.shape)) == bucket).all()
    assert len(np.unique(bucket)) > 1500  # by chance 1582 of 4096


def test_what_the_machine_was_given_comes_back_and_rows_far_off_are_left_out(tmp_path):
    file, truth = load_machine(MACHINE), np.array([0.04, 0.05, 0.03])
    drawing = file.machine.model_dump(mode="json", exclude_none=True)
    rig = replace(parse_rig({"machine": drawing, "seed": 5, "drive": {"backlash_mm": truth.tolist()}}), machine=file)
    path, out = tmp_path / "log.csv", tmp_path / "solved.toml"
    write_run(simulate(rig, make_volume(ideal_machine(rig.spec), 600, 3)).frame, path)
    rows = path.read_text().splitlines()
    titles, cells = rows[0].split(","), rows[300].split(",")
    place = titles.index("x_meas")
    cells[place] = str(float(cells[place]) + 0.3)
    path.write_text("\n".join([*rows[:300], ",".join(cells), *rows[301:]]) + "\n")
    model = tmp_path / "m.toml"
    model.write_text(MACHINE.read_text() + '\n[[effect]]\nname = "backlash"\n')
    found = fit_file(path, model, out)
    (term,) = read_model(load_machine(out)).terms
    assert term.std is not None
    pulls = (term.theta[:3].numpy() - truth) / term.std[:3].numpy()
    assert np.abs(pulls).max() < 4.0 and float(term.std[:3].max()) < 2e-3
    assert found.gross.tolist() == [299] and found.rows == len(read_table(path).measured) - 1
    assert load_machine(out).history[-1]["rows"] == found.rows


def test_what_is_not_fitted_part_by_part_is_refused_with_the_way_out(tmp_path):
    machine, path = load_machine(MACHINE), write_log(tmp_path / "log.parquet", 60)
    with pytest.raises(ModelError, match="add it on the rows"):
        fit_log(Model(machine) + make_effect(library(), "setup-jump"), open_log(machine, path))
    with pytest.raises(InputError, match="cannot be read"):
        open_log(machine, MACHINE)
    duckdb.connect().execute(f"COPY (SELECT 1 AS a) TO '{tmp_path}/b.parquet' (FORMAT parquet)")
    with pytest.raises(InputError, match="x_meas"):
        open_log(machine, tmp_path / "b.parquet")


READ = ["x_meas", "y_meas", "z_meas"]
LATE = [*range(20), *range(40, 60), *range(20, 40)]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda rows: rows.assign(z_meas=-rows["z_meas"]), "axis-sign"),
        (lambda rows: rows.assign(**rows[READ] / 1e3), "unit-scale"),
        (lambda rows: rows.iloc[LATE], "row 42, column time_s: time goes back"),
        (lambda rows: rows.assign(x_meas=[*rows["x_meas"][:49], "NaN", *rows["x_meas"][50:]]), "row 51, column x_meas"),
        (lambda rows: rows.iloc[:0], "log.csv: holds no rows"),
        (lambda rows: rows.iloc[:0, :0], "log.csv: .*export it again"),
    ],
    ids=["axis", "metres", "order", "text", "header alone", "empty"],
)
def test_a_log_that_a_run_of_its_rows_would_be_refused_for_is_refused(change, said, tmp_path):
    frame = table_to_frame(made(60))
    change(frame).to_csv(tmp_path / "log.csv", index=False)
    with pytest.raises((InputError, SetupError), match=said):
        fit_file(tmp_path / "log.csv", MACHINE, tmp_path / "out.toml")
    assert not (tmp_path / "out.toml").exists()


def test_a_column_without_a_number_keeps_no_sound_log_from_being_fitted(tmp_path):
    frame = table_to_frame(made(60)).assign(payload_kg="", note_s="no text of mine")
    frame.to_csv(tmp_path / "log.csv", index=False)
    to_parquet(tmp_path / "log.csv", tmp_path / "log.parquet")
    machine = load_machine(MACHINE)
    require_sound(machine, tmp_path / "log.parquet", tmp_path / "log.csv")
    assert open_log(machine, tmp_path / "log.parquet").rows == 60


def test_semicolons_and_decimal_commas_are_read_as_of_a_run(tmp_path):
    frame = table_to_frame(made(60))
    frame.to_csv(tmp_path / "log.csv", index=False)
    frame.to_csv(tmp_path / "office.csv", index=False, sep=";", decimal=",")
    machine, read = load_machine(MACHINE), []
    for name in ("log", "office"):
        to_parquet(tmp_path / f"{name}.csv", tmp_path / f"{name}.parquet")
        require_sound(machine, tmp_path / f"{name}.parquet", tmp_path / f"{name}.csv")
        read.append(read_log(machine, tmp_path / f"{name}.parquet", "LIMIT 60"))
    np.testing.assert_array_equal(read[0].measured, read[1].measured)
    np.testing.assert_array_equal(read[0].target, read[1].target)


@pytest.mark.parametrize("name", ["none.csv", "none.parquet"])
def test_a_log_that_is_not_there_is_named_and_what_is_read(name, tmp_path):
    with pytest.raises(InputError, match=rf"{name}: no such file; check the path; a log is Parquet, or a CSV"):
        fit_file(tmp_path / name, MACHINE, tmp_path / "out.toml")
