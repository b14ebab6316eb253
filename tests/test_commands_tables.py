"""The command line: what is refused or said of runs and targets, and what is written."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from test_commands_main import ROOT, error_line, invoke

from ptt.commands.main import run_alone
from ptt.door.outputs import refuse_readings
from ptt.errors import InputError

DATA = ROOT / "data"
MACHINE = str(DATA / "machine.toml")


def write(path: Path, frame: pd.DataFrame) -> Path:
    frame.to_csv(path, index=False)
    return path


@pytest.fixture(scope="module")
def run_frame() -> pd.DataFrame:
    return pd.read_csv(DATA / "experiment1.csv", nrows=120, keep_default_na=False, dtype=str)


@pytest.fixture(scope="module")
def target_frame() -> pd.DataFrame:
    return pd.read_csv(DATA / "targets.csv", nrows=40, dtype=str)


def change_target(frame: pd.DataFrame, row: int, **cells: str) -> pd.DataFrame:
    changed = frame.copy()
    for column, value in cells.items():
        changed.loc[row, column] = value
    return changed


def in_metres(frame: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    changed = frame.copy()
    for column in columns:
        numbers = pd.to_numeric(changed[column], errors="coerce") / 1000
        changed[column] = numbers.map(lambda value: "" if np.isnan(value) else repr(value))
    return changed


MEASURED = ["x_meas", "y_meas", "z_meas"]
RUN_FAULTS = {
    "missing column": (lambda f: f.drop(columns="x_meas"), ["x_meas", "missing"]),
    "text": (lambda f: change_target(f, 50, x_meas="--"), ["row 52", "x_meas", "'--'"]),
    "nan": (lambda f: change_target(f, 50, y_meas="NaN"), ["row 52", "y_meas", "NaN"]),
    "infinite": (lambda f: change_target(f, 50, y_meas="inf"), ["row 52", "y_meas"]),
    "unreachable command": (
        lambda f: change_target(f, 50, b1_cmd="900"),
        ["run.csv row 52, columns b1_cmd, b2_cmd, b3_cmd: the links do not meet"],
    ),
    "unreachable target": (
        lambda f: change_target(f[f["role"] != "base"].drop(columns=["b1_cmd", "b2_cmd", "b3_cmd"]), 50, x_cmd="900"),
        ["run.csv row 48, columns x_cmd, y_cmd, z_cmd: no joint values reach the target (1 of"],
    ),
    "metres": (lambda f: in_metres(f, MEASURED), ["metres"]),
    "metres everywhere": (
        lambda f: in_metres(
            f[f["role"] != "base"].drop(columns=["b1_cmd", "b2_cmd", "b3_cmd"]), [*MEASURED, "x_cmd", "y_cmd", "z_cmd"]
        ),
        ["metres"],
    ),
    "no rows": (lambda f: f[:0], ["no rows"]),
    "one row": (lambda f: f[10:11], ["one row"]),
}


@pytest.mark.parametrize("fault", RUN_FAULTS)
@pytest.mark.parametrize("verb", ["train", "evaluate"])
def test_bad_runs_are_refused_with_one_clear_line(fault, verb, run_frame, tmp_path, capsys):
    spoil, words = RUN_FAULTS[fault]
    code = 3 if "metres" in fault or "unreachable" in fault else 2
    run = write(tmp_path / "run.csv", spoil(run_frame))
    if verb == "train":
        with pytest.raises(SystemExit) as ended:
            run_alone("train", [str(run), "--machine", MACHINE, "--out", str(tmp_path / "out"), "--json"])
        printed = capsys.readouterr()
        line = printed.err
        assert ended.value.code == code and line.count("\n") == 1 and printed.out == ""
        assert not (tmp_path / "out").exists()
    else:
        line = error_line(invoke("evaluate", run, "--model", MACHINE, "--json"), code)
    assert "run.csv" in line and all(word in line for word in words), line


def test_an_empty_file_is_refused(tmp_path):
    (tmp_path / "run.csv").write_text("")
    assert "empty" in error_line(invoke("evaluate", tmp_path / "run.csv", "--model", MACHINE))


TARGET_FAULTS = {
    "missing column": (lambda f: f.drop(columns="y_cmd"), ["y_cmd", "missing"]),
    "text": (lambda f: change_target(f, 5, x_cmd="abc"), ["row 7", "x_cmd", "'abc'"]),
    "nan": (lambda f: change_target(f, 5, x_cmd="nan"), ["row 7", "x_cmd"]),
    "metres": (lambda f: in_metres(f, ["x_cmd", "y_cmd", "z_cmd"]), ["metres"]),
    "no rows": (lambda f: f[:0], ["no rows"]),
}


@pytest.mark.parametrize("fault", TARGET_FAULTS)
def test_bad_targets_are_refused_with_one_clear_line(fault, target_frame, tmp_path):
    spoil, words = TARGET_FAULTS[fault]
    targets = write(tmp_path / "targets.csv", spoil(target_frame))
    made = invoke("predict", targets, "--model", MACHINE, "--out", tmp_path / "out.csv")
    line = error_line(made, 3 if fault == "metres" else 2)
    assert "targets.csv" in line and all(word in line for word in words), line
    assert not (tmp_path / "out.csv").exists()


def test_a_person_who_states_the_unit_is_believed(target_frame, tmp_path):
    targets = write(tmp_path / "t.csv", in_metres(target_frame, ["x_cmd", "y_cmd", "z_cmd"]))
    answers = tmp_path / "map.toml"
    answers.write_text('[units]\nx_cmd = "mm"\ny_cmd = "mm"\nz_cmd = "mm"\n')
    result = invoke("predict", targets, "--model", MACHINE, "--out", tmp_path / "o.csv", "--map", answers)
    assert result.exit_code == 0, result.stderr


def test_rows_that_cannot_be_sent_have_a_status_and_the_file_is_written(target_frame, tmp_path):
    spoilt = change_target(change_target(change_target(target_frame, 5, z_cmd="140"), 7, x_cmd="900"), 9, y_cmd="-900")
    targets = write(tmp_path / "t.csv", spoilt)
    result = invoke("predict", targets, "--model", MACHINE, "--out", tmp_path / "o.csv", "--json")
    counts = {status: count for status, count in json.loads(result.stdout)["status"].items() if count}
    assert result.exit_code == 3 and counts == {"ok": 37, "out of travel": 1, "out of reach": 2}
    frame = pd.read_csv(tmp_path / "o.csv")
    assert frame["status"].tolist().index("out of travel") == 5 and frame["b1"].isna().sum() == 3
    assert "1 out of travel (row 7); 2 out of reach (rows 9, 11)" in result.stderr


def test_one_target_can_be_predicted(target_frame, tmp_path):
    targets = write(tmp_path / "t.csv", target_frame[:1])
    assert invoke("predict", targets, "--model", MACHINE, "--out", tmp_path / "o.csv").exit_code == 0
    assert len(pd.read_csv(tmp_path / "o.csv")) == 1


def test_commands_of_a_bare_drawing_are_said_to_be_that(target_frame, tmp_path):
    targets, solved = write(tmp_path / "t.csv", target_frame), tmp_path / "solved.toml"
    effect = '\n[[effect]]\nname = "backlash"\n[effect.parameters]\ngap_mm = { value = 0.1 }\n'
    solved.write_text(Path(MACHINE).read_text() + effect)
    bare, known = (invoke("predict", targets, "--model", m, "--out", tmp_path / "o.csv") for m in (MACHINE, solved))
    assert bare.exit_code == known.exit_code == 0
    assert "no effects" in bare.stderr and "no effects" not in known.stderr


def test_simulate_refuses_sliders_made_for_other_targets(target_frame, tmp_path):
    sliders = tmp_path / "s.csv"
    assert invoke("predict", DATA / "targets_unseen.csv", "--model", MACHINE, "--out", sliders).exit_code == 0
    rig = DATA / "rigs" / "experiment1.toml"
    shorter = write(tmp_path / "t.csv", target_frame)
    line = error_line(invoke("simulate", rig, shorter, "--sliders", sliders, "--out", tmp_path / "r.csv"))
    assert "s.csv" in line and "40 targets" in line
    other = write(tmp_path / "u.csv", pd.read_csv(DATA / "targets.csv")[:150])
    line = error_line(invoke("simulate", rig, other, "--sliders", sliders, "--out", tmp_path / "r.csv"))
    assert "another target" in line and not (tmp_path / "r.csv").exists()


def test_commands_beside_the_targets_are_driven_and_said_so(target_frame, tmp_path):
    targets, sliders = write(tmp_path / "t.csv", target_frame), tmp_path / "s.csv"
    assert invoke("predict", targets, "--model", MACHINE, "--out", sliders).exit_code == 0
    frame = pd.read_csv(sliders)
    write(sliders, frame.assign(b1=frame["b1"] + 0.1))
    rig = DATA / "rigs" / "experiment1.toml"
    alone = invoke("simulate", rig, sliders, "--out", tmp_path / "a.csv", "--json")
    assert json.loads(alone.stdout)["sliders"] == "given" and "driven by the commands b1.." in alone.stderr
    invoke("simulate", rig, sliders, "--sliders", sliders, "--out", tmp_path / "b.csv")
    invoke("simulate", rig, targets, "--out", tmp_path / "c.csv")
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes() != (tmp_path / "c.csv").read_bytes()


@pytest.mark.parametrize("verb", ["plan", "predict"])
def test_readings_are_never_overwritten_but_earlier_output_is(verb, run_frame, target_frame, tmp_path):
    out = write(tmp_path / "run.csv", run_frame)
    before = out.read_bytes()
    given = [write(tmp_path / "t.csv", target_frame), "--model", MACHINE] if verb == "predict" else [MACHINE]
    more = [] if verb == "predict" else ["--rows", "120"]
    line = error_line(invoke(verb, *given, *more, "--out", out))
    assert line.endswith("run.csv: holds readings; nothing was written; name another file")
    assert out.read_bytes() == before
    for _ in range(2):
        assert invoke(verb, *given, *more, "--out", tmp_path / "new.csv").exit_code == 0


def test_readings_are_seen_in_another_encoding_too(run_frame, tmp_path):
    run_frame.to_csv(tmp_path / "wide.csv", index=False, encoding="utf-16")
    with pytest.raises(InputError, match="holds readings"):
        refuse_readings(tmp_path / "wide.csv")


def test_swapped_targets_are_named(run_frame, tmp_path):
    swapped = write(tmp_path / "swap.csv", run_frame.assign(x_cmd=run_frame["y_cmd"], y_cmd=run_frame["x_cmd"]))
    line = error_line(invoke("fit", swapped, "--model", MACHINE), code=3)
    assert "swap.csv: axes-swapped: targets and commands differ by " in line and "x and y of the targets" in line
    said = json.loads(invoke("diagnose", swapped, "--model", MACHINE, "--json").stdout)
    assert said["verdict"] == "setup" and said["setup"][0]["mistake"] == "axes-swapped"


def test_no_verdict_on_a_handful_of_readings(run_frame, tmp_path):
    base, poses = run_frame[run_frame["role"] == "base"], run_frame[run_frame["role"] != "base"]
    few = write(tmp_path / "few.csv", pd.concat([base[:8], poses[:11]]))
    line = error_line(invoke("diagnose", few, "--model", MACHINE), code=3)
    assert "few.csv: 11 readings are too few for a verdict" in line and "at least 12 poses" in line
    again = write(
        tmp_path / "again.csv", pd.concat([base[:8], *(poses[:2].assign(time_s=900.0 + 2.0 * k) for k in range(10))])
    )
    line = error_line(invoke("diagnose", again, "--model", MACHINE), code=3)
    assert "readings of 2 poses are too few for a verdict" in line


def test_simulate_writes_run_and_truth(target_frame, tmp_path):
    targets = write(tmp_path / "t.csv", target_frame)
    common_args = ["simulate", DATA / "rigs" / "experiment1.toml", targets, "--truth", tmp_path / "truth.csv", "--json"]
    first = invoke(*common_args, "--out", tmp_path / "a.csv", "--no-noise")
    data = json.loads(first.stdout)
    assert data["poses"] == 7 * 40 and data["sliders"] == "controller"
    run, truth = pd.read_csv(tmp_path / "a.csv"), pd.read_csv(tmp_path / "truth.csv")
    assert len(run) == len(truth) == data["rows"]
    assert np.isfinite(truth[["x_true", "y_true", "z_true", "b1_true"]].to_numpy()).all()
    invoke(*common_args, "--out", tmp_path / "b.csv", "--no-noise")
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
