"""The verb compare: JSON, text, pictures, and what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.image import imread
from test_compare import NOISE, machine, moved_sliders, places, with_noise

from ptt.commands.main import run_alone
from ptt.judge.compare.comparison import compare_run
from ptt.machine import save_machine
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.run.written import write_table
from ptt.show.plots.compare import plot_comparison
from ptt.show.sizing import round_down

DATA = Path(__file__).resolve().parents[1] / "data"
KEYS = {
    "rows", "frame_removed_um", "rms_um", "mean_um", "p95_um", "max_um", "noise_um", "explainable_share", "depends_on",
}  # fmt: skip


def test_all_pictures_are_drawn_and_show_something(tmp_path):
    file, lead = machine("fitted", NOISE), 5.0
    warm = np.linspace(20.0, 35.0, 240)
    change = lambda q, direction: 0.02 * np.sin(2 * np.pi * q / lead) - 0.002 * (warm - 20.0)[:, None] * direction  # noqa: E731
    table = with_noise(moved_sliders(file, places(240), change, temp_c=warm, time_s=np.arange(240) * 5.0))
    problem = build_problem(file, table)
    told = []
    drawn = plot_comparison(
        compare_run(Model(file), problem), problem, tmp_path / "new", progress=lambda what, done, of: told.append(what)
    )
    assert [path.stem for path in drawn] == ["error_field", "depends_on", "over_time", "histogram", "periodogram"]
    assert len(told) == 5
    for path in drawn:
        picture = imread(path)
        assert picture.shape[0] > 300 and picture.shape[1] > 700
        colour = np.round(100.0 * picture[..., :3]) @ [1e6, 1e3, 1.0]  # one number each: rows sort slowly
        assert len(np.unique(colour)) > 20
        assert 0.01 < (picture[..., :3].min(axis=-1) < 0.9).mean() < 0.6


def test_pictures_of_a_short_run_leave_out_the_periodogram(tmp_path):
    file, target = machine("fitted", NOISE), places(9)
    problem = build_problem(file, with_noise(make_table(target, measured=target)))
    drawn = plot_comparison(compare_run(Model(file), problem), problem, tmp_path)
    assert [path.stem for path in drawn] == ["error_field", "depends_on", "over_time", "histogram"]


@given(st.floats(1e-6, 1e6))
def test_scales_are_round_and_no_larger(value):
    rounded = round_down(value)
    assert rounded <= value * (1 + 1e-8)
    assert value < 2.5 * rounded * (1 + 1e-8)
    assert min(abs(rounded / 10.0 ** np.floor(np.log10(rounded * (1 + 1e-9))) - step) for step in (1, 2, 5)) < 1e-6


@pytest.fixture
def files(tmp_path):
    target = np.tile(places(40), (3, 1))
    write_table(with_noise(make_table(target, measured=target + 0.02 * np.sin(target / 20))), tmp_path / "run.csv")
    save_machine(machine("fitted"), tmp_path / "m.toml")
    return tmp_path


def test_command_prints_json_and_nothing_else(files):
    outcome = invoke("compare", files / "run.csv", "--model", files / "m.toml", "--json")
    assert outcome.exit_code == 0, outcome.stderr
    data = json.loads(outcome.stdout)
    assert set(data) >= KEYS
    for key in ("frame_removed_um", "rms_um", "mean_um", "p95_um", "max_um"):
        assert set(data[key]) == {"x", "y", "z", "total"}
    assert set(data["noise_um"]) == {"x", "y", "z", "total", "source"}
    assert data["rows"] == 120
    assert data["network_left_aside"] is False
    assert 0.5 < data["explainable_share"] < 1.0


def test_command_prints_text_and_draws(files):
    outcome = invoke("compare", files / "run.csv", "--model", files / "m.toml", "--plots", files / "pictures")
    assert outcome.exit_code == 0, outcome.stderr
    assert "more than noise" in outcome.stdout
    assert "pictures in" in outcome.stderr and "pictures in" not in outcome.stdout
    assert len(list((files / "pictures").glob("*.png"))) == 5


def test_command_without_any_word_on_noise_compares_all_the_same(tmp_path):
    target = places(8)
    write_table(with_noise(make_table(target, measured=target)), tmp_path / "run.csv")
    save_machine(machine("fitted"), tmp_path / "m.toml")
    outcome = invoke("compare", tmp_path / "run.csv", "--model", tmp_path / "m.toml", "--json")
    assert outcome.exit_code == 0, outcome.stderr
    assert json.loads(outcome.stdout)["noise_um"]["source"] == "unknown"
    assert "noise floor unknown" in outcome.stderr


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("none.csv", "--model", "m.toml"), "none.csv"),
        (("run.csv", "--model", "none.toml"), "none.toml"),
        (("run.csv",), "--model"),
        (("bad.csv", "--model", "m.toml"), "bad.csv"),
        (("far.csv", "--model", "m.toml"), "far.csv"),
        (("few.csv", "--model", "m.toml"), "few.csv"),
        (("run.csv", "--model", "m.toml", "--set", "payload_kg"), "--set"),
    ],
)
def test_bad_input_is_one_clear_line(files, monkeypatch, words, named):
    monkeypatch.chdir(files)
    head = "x_cmd,y_cmd,z_cmd,x_meas,y_meas,z_meas\n"
    Path("bad.csv").write_text(head + "1,2,3,1,2,--\n" * 5)
    Path("far.csv").write_text(head + "".join(f"{900 + i},2,3,{900 + i},2,3\n" for i in range(6)))
    Path("few.csv").write_text(head + "1,2,3,1,2,3\n")
    outcome = invoke("compare", *words)
    assert outcome.exit_code == (3 if named == "far.csv" else 2)
    assert outcome.stdout == ""
    errors = [line for line in outcome.stderr.splitlines() if line.startswith("error:")]
    assert len(errors) == 1 and named in errors[0]
    assert "Traceback" not in outcome.stderr


def test_compensator_network_is_left_aside_and_said_so(tmp_path):
    target = np.tile(places(50), (2, 1))
    write_table(with_noise(make_table(target, measured=target + 0.03 * np.sin(target / 20))), tmp_path / "run.csv")
    save_machine(machine("fitted", NOISE), tmp_path / "m.toml")
    files = [str(tmp_path / name) for name in ("run.csv", "m.toml", "comp")]
    with pytest.raises(SystemExit) as ended:
        run_alone("train", [files[0], "--machine", files[1], "--out", files[2]])
    assert not ended.value.code
    bare = json.loads(invoke("compare", tmp_path / "run.csv", "--model", tmp_path / "m.toml", "--json").stdout)
    outcome = invoke("compare", tmp_path / "run.csv", "--model", tmp_path / "comp", "--json")
    data = json.loads(outcome.stdout)
    assert data["network_left_aside"] is True
    assert "left aside" in outcome.stderr
    assert data["rms_um"] == pytest.approx(bare["rms_um"], rel=1e-6)


@pytest.mark.parametrize("name", ["experiment1", "volume"])
def test_sample_runs(name):
    outcome = invoke("compare", DATA / f"{name}.csv", "--model", DATA / "machine.toml", "--json")
    data = json.loads(outcome.stdout)
    assert data["rms_um"]["total"] > 10.0 * data["noise_um"]["total"]
    assert data["lack_of_fit"]["p_value"] < 1e-12
    assert data["frame_removed_um"]["total"] > 300.0
    assert data["depends_on"][0]["share"] > 0.5
