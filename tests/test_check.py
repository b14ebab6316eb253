"""Set-up mistakes are named with a proof and undone; sound set-ups are left alone."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.setup_mistakes import CASES, agreement, draw_run, try_case
from ptt.commands.main import run_alone
from ptt.machine import MachineFile, load_machine, parse_machine
from ptt.run.reading import read_table
from ptt.run.table import Table, concat_tables, make_table, take_rows, write_table
from ptt.setup import MISTAKES, check_setup, rows
from ptt.setup.machine import describe_machine

DATA = Path(__file__).parent.parent / "data" / "sealed_one"


@pytest.fixture(scope="module")
def sound() -> tuple[MachineFile, Table]:
    return load_machine(DATA / "machine.toml"), read_table(DATA / "run.csv")


def run_verb(verb: str, *arguments: object) -> int:
    with pytest.raises(SystemExit) as ended:
        run_alone(verb, [str(argument) for argument in arguments])
    return int(ended.value.code or 0)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.title)
def test_every_mistake_is_named_and_cured_on_foreign_machines(case: object) -> None:
    """Two drawn machines each, run with everything; the benchmark does it on twenty and with fewer columns."""
    for seed in (0, 6):
        have = case.have[0]  # type: ignore[attr-defined]
        tried = try_case(case, have, seed)  # type: ignore[arg-type]
        assert tried.shows
        assert tried.named, (seed, str(tried.found))
        assert tried.cured, (seed, str(tried.found))


@pytest.mark.parametrize("seed", range(12))
def test_sound_set_ups_with_faults_are_not_accused(seed: int) -> None:
    file, table = draw_run(20_000 + seed, faults=seed % 4, rows=None if seed % 2 else 20)
    for have in (table, table.replace(target=np.full_like(table.target, np.nan)), table.replace(command=None)):
        assert check_setup(file, have).findings == ()


def test_the_sample_runs_are_sound(sound: tuple[MachineFile, Table]) -> None:
    assert check_setup(*sound).findings == ()
    root = DATA.parent
    for run, machine in (("experiment1.csv", "machine.toml"), ("volume.csv", "machine.toml")):
        assert check_setup(load_machine(root / machine), read_table(root / run)).findings == ()


def set_up_anew(file: MachineFile, table: Table) -> tuple[MachineFile, Table]:
    """All but the first third as a run of its own, its readings in another frame of the tracker."""
    run = (np.arange(table.rows) >= table.rows // 3).astype(int)
    turn = Rotation.from_rotvec([0.3, -0.5, 0.9]).as_matrix()
    measured = np.where(run[:, None] == 0, table.measured, table.measured @ turn.T + [900.0, -400.0, 250.0])
    own = replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted-per-run"}))
    return own, table.replace(measured=measured, run=run, run_label=("1", "2"))


def test_a_tracker_set_up_anew_for_each_run_is_no_other_reflector(sound: tuple[MachineFile, Table]) -> None:
    file, table = set_up_anew(*sound)
    found = check_setup(file, table)
    assert found.findings == () and found.table is not None
    np.testing.assert_array_equal(found.table.measured, table.measured)
    one_frame = replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted"}))
    accused = check_setup(one_frame, table).sure
    assert [item.mistake for item in accused] == ["wrong-reflector"] and "fitted-per-run" in accused[0].fix
    one_run = table.replace(run=np.zeros(table.rows, int), run_label=("",))
    assert "fitted-per-run" not in check_setup(one_frame, one_run).sure[0].fix


@pytest.mark.parametrize(("aside_mm", "accused"), [(100.0, True), (15.0, False)])
def test_files_in_one_frame_that_the_tracker_read_from_two_places(
    sound: tuple[MachineFile, Table], aside_mm: float, accused: bool
) -> None:
    """Sliders that were homed anew between two files move readings as well: no other place of the tracker."""
    file, table = sound
    second = table.replace(measured=table.measured + np.array([aside_mm, 0.0, 0.0]), source="second.csv")
    found = check_setup(file, concat_tables([table, second]))
    assert [item.mistake for item in found.sure] == ["wrong-reflector"] * accused
    assert all("second.csv" in item.words and "fitted-per-run" in item.fix for item in found.sure)
    assert found.file.tracker.frame == ("fitted-per-run" if accused else "fitted")
    assert not check_setup(found.file, concat_tables([table, second])).findings


def test_a_mistake_in_one_of_two_set_ups_is_found_and_undone(sound: tuple[MachineFile, Table]) -> None:
    file, table = set_up_anew(*sound)
    block = np.arange(table.rows)[table.run == 1][40:60]
    measured = table.measured.copy()
    measured[block] += [30.0, 0.0, 40.0]
    found = check_setup(file, table.replace(measured=measured))
    assert [item.mistake for item in found.sure] == ["wrong-reflector"] and found.table is not None
    np.testing.assert_allclose(found.table.measured, table.measured, atol=0.5)
    np.testing.assert_array_equal(found.table.line, table.line)


def test_a_block_on_another_reflector_is_found_as_well_one_start_at_a_time(
    sound: tuple[MachineFile, Table], monkeypatch: pytest.MonkeyPatch
) -> None:
    file, table = sound
    measured = table.measured.copy()
    measured[60:140] += [30.0, -12.0, 25.0]
    run = table.replace(measured=measured)
    together = check_setup(file, run)
    assert [item.mistake for item in together.sure] == ["wrong-reflector"]
    monkeypatch.setattr(rows, "AT_ONCE", 1)
    assert check_setup(file, run).findings == together.findings


@pytest.mark.parametrize("missed", [40, 121, 122, 200])
def test_the_reading_that_was_missed_is_the_one_left_empty(sound: tuple[MachineFile, Table], missed: int) -> None:
    file, table = sound
    early = np.vstack([np.delete(table.measured, missed, axis=0), table.measured[-1:]])[:-1]
    rows = take_rows(table, np.arange(table.rows - 1))
    found = check_setup(file, rows.replace(measured=early))
    assert [item.mistake for item in found.findings] == ["row-shift"]
    assert f"from row {table.line[missed]} on" in found.findings[0].words
    true = table.measured[:-1].copy()
    true[missed] = np.nan
    assert found.table is not None
    np.testing.assert_array_equal(found.table.measured, true)


def test_what_is_the_same_thing_is_said_as_one(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    found = check_setup(file, table.replace(measured=table.measured * [1.0, 1.0, -1.0]))
    (only,) = found.findings
    assert only.mistake == "axis-sign"
    assert "z negated" in only.words
    assert "swapped" in only.words
    assert only.before_um is not None and only.after_um is not None
    assert only.before_um > 1000.0 * only.after_um


def test_a_blunder_of_the_drawing_is_cured_in_its_text() -> None:
    text = (
        '[machine] # ours\nkind = "three-ptt"\nbase_radius_mm = 100\nplatform_radius_mm = 200\nlink_length_mm = 300\n'
    )
    drawing = parse_machine(text + "slider_travel_mm = [150, 420]\n")
    run = read_table(DATA / "run.csv")
    found = check_setup(drawing, run)
    assert [item.mistake for item in found.findings] == ["radii-interchanged"]
    assert "# ours" in found.file.text
    assert parse_machine(found.file.text).machine.base_radius_mm == 200.0  # type: ignore[union-attr]


def test_sixty_readings_of_one_pose_are_no_unit_mistake(sound: tuple[MachineFile, Table]) -> None:
    random = np.random.default_rng(3)
    pose = np.tile([10.0, 20.0, -5.0], (60, 1))
    table = make_table(pose, None, pose + random.normal(0.0, 0.004, (60, 3)))
    assert check_setup(sound[0], table).findings == ()


def test_readings_a_constant_aside_are_no_two_units_at_once(sound: tuple[MachineFile, Table]) -> None:
    """Shrunk a hundredfold, what is off by two centimetres would be a matter of ordinary faults."""
    file, table = sound
    trusted = replace(file, tracker=file.tracker.model_copy(update={"frame": "trusted"}))
    moved = replace(table, measured=table.target + np.array([-15.5, 6.6, 8.5]), command=None)
    found = check_setup(trusted, moved)
    assert "unit-scale" not in [finding.mistake for finding in found.findings]
    assert "no machine is built so far off" in found.unexplained


def test_compensated_commands_are_no_mistake(sound: tuple[MachineFile, Table]) -> None:
    """Commands that a compensation moved by up to a millimetre lie beside the targets' own."""
    file, table = sound
    assert table.command is not None
    away = np.sin(table.target / 20.0)
    assert check_setup(file, table.replace(command=table.command + away)).findings == ()


def test_two_mistakes_are_both_named(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    assert table.command is not None
    broken = table.replace(
        measured=table.measured / 25.4, command=table.command[:, [1, 0, 2]], temp_c=table.temp_c + 273.15
    )
    found = check_setup(file, broken)
    assert {item.mistake for item in found.sure} == {"unit-scale", "slider-order", "temperature-unit"}
    assert found.table is not None
    assert (agreement(found.file, found.table) < 1.5 * agreement(file, table)).all()


def test_check_writes_json_and_cured_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = read_table(DATA / "run.csv")
    write_table(run.replace(measured=run.measured / 25.4), tmp_path / "inch.csv")
    code = run_verb(
        "check", tmp_path / "inch.csv", "--model", DATA / "machine.toml", "--out-run", tmp_path / "cured.csv",
        "--out-model", tmp_path / "cured.toml", "--json",
    )  # fmt: skip
    said = json.loads(capsys.readouterr().out)
    assert code == 0
    assert said["ok"] is False
    assert said["findings"][0]["mistake"] == "unit-scale"
    assert set(said["findings"][0]) == {"mistake", "words", "fix", "rms_um", "sure"}
    np.testing.assert_allclose(read_table(tmp_path / "cured.csv").measured, run.measured, rtol=1e-12)
    assert load_machine(tmp_path / "cured.toml") == load_machine(DATA / "machine.toml")


def test_verbs_refuse_what_is_sure_and_go_on_anyway(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], sound: tuple[MachineFile, Table]
) -> None:
    broken = tmp_path / "broken.csv"
    write_table(sound[1].replace(measured=sound[1].measured * [1.0, 1.0, -1.0]), broken)
    given = (broken, "--model", DATA / "machine.toml", "--json")
    assert run_verb("diagnose", *given) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["verdict"] == "setup"
    assert said["suggested"] == []
    assert said["verdict_probability"] == {"missing": 0.0, "nothing-missing": 0.0, "unknown": 0.0}
    assert said["setup"][0]["mistake"] == "axis-sign"
    assert run_verb("fit", *given) == 3
    assert "axis-sign" in capsys.readouterr().err
    assert run_verb("fit", *given, "--anyway") == 0
    assert run_verb("compare", broken, "--model", DATA / "machine.toml") == 0
    assert capsys.readouterr().out.splitlines()[-1]


def test_a_machine_file_alone_is_described_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_verb("check", DATA / "machine.toml", "--drawing", tmp_path / "bench.png") == 0
    assert run_verb("check", DATA / "machine.toml", "--drawing", tmp_path / "bench.csv") == 2
    assert not (tmp_path / "bench.csv").exists()
    assert "b1 = 282.843" in capsys.readouterr().out  # sqrt(300^2 - 100^2)
    assert (tmp_path / "bench.png").read_bytes().startswith(b"\x89PNG")


def test_a_picture_that_cannot_be_written_fails_no_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "machine.toml"
    path.write_bytes((DATA / "machine.toml").read_bytes())
    (tmp_path / "machine_drawing.png").mkdir()
    assert run_verb("check", path, "--json") == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["drawing"] is None and "not drawn: " in told.err
    assert run_verb("check", path, "--drawing", tmp_path / "machine_drawing.png") == 2


def test_reach_of_a_machine_stays_within_the_travel(sound: tuple[MachineFile, Table]) -> None:
    """On the axis every slider stands at z + sqrt(L^2 - (R - r)^2), so travel ends are the reach but for a step."""
    said = describe_machine(sound[0])
    drop = np.sqrt(300.0**2 - 100.0**2)
    assert said.reach_mm[1] == pytest.approx(150.0 - drop, abs=3.0)
    assert said.reach_mm[2] == pytest.approx(420.0 - drop, abs=3.0)


def directions(table: Table, sign: float) -> Table:
    """The run with the direction of each move stated, or the opposite of it; unknown in its first row."""
    assert table.command is not None
    moved = np.diff(table.command, axis=0, prepend=np.nan)
    return table.replace(direction=np.where(np.abs(moved) > 1e-6, sign * np.sign(moved), np.nan))


def test_directions_opposite_to_the_moves_are_named_and_turned_round(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    found = check_setup(file, directions(table, -1.0))
    assert [item.mistake for item in found.sure] == ["direction-sign"] and "dir1, dir2, dir3" in found.sure[0].fix
    assert found.table is not None
    np.testing.assert_array_equal(found.table.direction, directions(table, 1.0).direction)
    one = directions(table, 1.0)
    assert one.direction is not None
    found = check_setup(file, one.replace(direction=one.direction * [1.0, -1.0, 1.0]))
    assert "write dir2 with" in found.sure[0].fix


def test_directions_are_surely_wrong_only_where_play_shows_it(sound: tuple[MachineFile, Table]) -> None:
    """A machine without play that overtravels in every move is stated alike."""
    file, table = sound
    noise = np.random.default_rng(1).normal(0.0, 0.003, table.target.shape)
    found = check_setup(file, directions(table, -1.0).replace(measured=table.target + noise))
    assert [(item.mistake, item.sure) for item in found.findings] == [("direction-sign", False)]


def test_directions_of_joints_that_overtravel_are_not_accused(sound: tuple[MachineFile, Table]) -> None:
    """Stated as the moves go, from one side always, or opposite where the play of the readings says the same."""
    file, table = sound
    always = table.replace(direction=np.ones((table.rows, 3)))
    beyond = directions(table, -1.0).replace(measured=2.0 * table.target - table.measured)
    for run in (directions(table, 1.0), always, beyond):
        assert check_setup(file, run).findings == ()


@pytest.mark.parametrize("title", ["temp_c", "payload_kg", "feed_mm_s"])
@pytest.mark.parametrize("rows", [[9], [9, 41, 42]])
def test_values_that_cannot_be_are_named_by_their_rows(
    sound: tuple[MachineFile, Table], title: str, rows: list[int]
) -> None:
    file, table = sound
    values = np.full(table.rows, 20.0)
    values[rows] = 1e5
    found = check_setup(file, table.replace(**{title: values}))
    assert [item.mistake for item in found.sure] == ["stray-value"] == [item.mistake for item in found.findings]
    lines = ", ".join(str(table.line[row]) for row in rows)
    assert f"{title} is 100,000" in found.sure[0].words and f"row{'s' * (len(rows) > 1)} {lines}, and 20" in str(found)
    assert found.table is not None and np.isnan(getattr(found.table, title)[rows]).all()


def test_a_column_that_is_hot_or_heavy_throughout_or_grows_so_has_no_stray_values(
    sound: tuple[MachineFile, Table],
) -> None:
    file, table = sound
    warming = table.replace(temp_c=np.linspace(20.0, 101.0, table.rows))
    assert "stray-value" not in str(check_setup(file, warming))
    grams = table.replace(payload_kg=np.where(np.arange(table.rows) % 3 == 0, 2500.0, 0.0))
    assert [item.mistake for item in check_setup(file, grams).findings] == ["payload-unit"]


def test_a_target_far_from_its_own_commands_is_named(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    target = table.target.copy()
    target[20] = 5000.0, 0.0, 0.0
    found = check_setup(file, table.replace(target=target))
    assert [item.mistake for item in found.findings] == ["stray-value"] and found.sure
    assert f"the target of row {table.line[20]} lies" in found.sure[0].words
    np.testing.assert_allclose(found.table.target, table.target, atol=1e-3)  # type: ignore[union-attr]


def test_names_are_those_of_the_contract() -> None:
    assert len(MISTAKES) == 23
    used = {name for case in CASES for name in case.names}
    assert used <= set(MISTAKES)


@pytest.mark.parametrize("rows", [3, 60])
def test_too_little_to_judge_is_said(sound: tuple[MachineFile, Table], rows: int) -> None:
    """Three poses, or sixty readings of one: nothing was judged, and nothing is said to hold together."""
    file, table = sound
    few = take_rows(table, np.arange(3) if rows == 3 else np.zeros(rows, dtype=int))
    found = check_setup(file, few)
    assert found.ok and "too little to judge" in str(found)
    assert found.to_dict()["too_little"] == f"{1 if rows == 60 else 3} different pose{'' if rows == 60 else 's'} " + (
        "with a reading, and it takes 5"
    )
    assert check_setup(file, table).to_dict()["too_little"] is None


def test_a_small_path_shows_its_mistake_by_a_steep_fall() -> None:
    """The machine stands on its other side, the path is 36 mm high: 1.6 mm, and 4 um with the sliders above."""
    case = next(case for case in CASES if case.title == "sliders on the wrong side")
    tried = try_case(case, "sliders", 5005)
    assert tried.named and tried.cured, str(tried.found)


def test_a_length_that_the_controller_has_is_named_by_its_digits() -> None:
    """25 mm more on the links moves the targets of a small path by 0.4 mm against the commands, but exactly."""
    case = next(case for case in CASES if case.title == "a length off by 20 to 50 mm")
    tried = try_case(case, "both", 5002)
    assert tried.named and tried.cured, str(tried.found)
    assert "targets and commands differ by 424 um" in tried.found.findings[0].words


def test_sliders_on_a_small_path_are_no_row_shift() -> None:
    """A row less brings the error from 1,044 to 205 um there, the sliders' true order to 153."""
    case = next(case for case in CASES if case.title == "sliders numbered the other way")
    tried = try_case(case, "sliders", 5003)
    assert [item.mistake for item in tried.found.findings] in ([], ["slider-order"])


def test_time_in_ms_shows_beside_the_feed(sound: tuple[MachineFile, Table]) -> None:
    """Rows that take a thousand times as long as their way at the feed, whatever the feed: nobody waits like that."""
    file, table = sound
    feed = np.where(np.arange(table.rows) % 3 == 0, 8.0, 40.0)
    way = np.linalg.norm(np.diff(table.target, axis=0, prepend=table.target[:1]), axis=1)
    seconds = np.cumsum(np.nan_to_num(way) / feed + 1e-3)
    timed = table.replace(feed_mm_s=feed, time_s=1e3 * seconds)
    assert [item.mistake for item in check_setup(file, timed).sure] == ["time-unit"]
    for sound_clock in (seconds, 100.0 * np.arange(table.rows), seconds + 100.0 * np.arange(table.rows)):
        assert check_setup(file, table.replace(feed_mm_s=feed, time_s=sound_clock)).findings == ()


def test_targets_in_metres_are_no_mistake_of_the_clock() -> None:
    case = next(case for case in CASES if case.title == "targets in metres")
    tried = try_case(case, "targets", 6000)
    assert [item.mistake for item in tried.found.findings] == ["unit-scale"]


def slips(sound: tuple[MachineFile, Table], *missed: int) -> np.ndarray:
    """Readings of which some were missed, those after each moved up."""
    kept = np.delete(sound[1].measured, missed, axis=0)
    return np.vstack([kept, np.full((len(missed), 3), np.nan)])


def test_two_readings_missed_are_found_both(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    found = check_setup(file, table.replace(measured=slips(sound, 70, 211)))
    assert {item.mistake for item in found.sure} == {"row-shift"}
    assert found.table is not None
    true = table.measured.copy()
    true[[70, 211]] = np.nan
    np.testing.assert_array_equal(found.table.measured, true)


@pytest.mark.parametrize("factor", [1.0, 1.0 / 25.4])
def test_a_missed_reading_in_a_left_handed_frame(sound: tuple[MachineFile, Table], factor: float) -> None:
    """Neither shows without the other; in inches on top there are three mistakes."""
    file, table = sound
    found = check_setup(file, table.replace(measured=factor * slips(sound, 122) * [1.0, 1.0, -1.0]))
    assert {item.mistake for item in found.sure} == {"row-shift", "axis-sign"} | (
        {"unit-scale"} if factor < 1 else set()
    )
    assert found.table is not None
    cured = agreement(found.file, found.table)
    assert (cured < 1.5 * agreement(file, table) + 1e-3).all()


@pytest.mark.parametrize("factor", [25.4, 1e3])
def test_a_run_in_one_wrong_unit_agrees_with_itself_and_not_with_the_travel(
    sound: tuple[MachineFile, Table], factor: float
) -> None:
    file, table = sound
    assert table.command is not None
    small = table.replace(
        target=table.target / factor, command=table.command / factor, measured=table.measured / factor
    )
    (only,) = check_setup(file, small).findings
    assert only.mistake == "unit-scale"
    assert "every length of the run" in only.words and "travel" in only.words


def test_readings_from_the_last_row_to_the_first() -> None:
    file, table = draw_run(9003, rows=60)
    (only,) = check_setup(file, table.replace(measured=table.measured[::-1])).findings
    assert only.mistake == "row-order" and "from the last row to the first" in only.words


def test_sliders_out_of_travel_are_not_taken_as_micrometres(sound: tuple[MachineFile, Table]) -> None:
    """Counted downward from 900 mm they lie beyond a travel that has zero in it, and a thousandth of them within."""
    file, table = sound
    assert table.command is not None
    spec = file.machine.model_copy(update={"slider_travel_mm": ((-420.0, 420.0),) * 3})
    found = check_setup(replace(file, machine=spec), table.replace(command=900.0 - table.command))
    assert [item.mistake for item in found.sure] == ["slider-sign"]
    assert found.sure[0].fix == "write b1_cmd = 900 - b1_cmd, b2_cmd = 900 - b2_cmd, b3_cmd = 900 - b3_cmd"


def test_readings_of_every_second_row_may_be_late(sound: tuple[MachineFile, Table]) -> None:
    """Moved back, they stand in rows that had none before: no row tells both errors."""
    file, table = sound
    every = np.where(np.arange(table.rows)[:, None] % 2 == 0, table.measured, np.nan)
    found = check_setup(file, table.replace(measured=np.roll(every, 1, axis=0)))
    assert [item.mistake for item in found.sure] == ["row-shift"]
    assert "late from the first row on" in found.sure[0].words


def test_a_machine_file_in_metres_is_not_cured_by_a_smaller_run(sound: tuple[MachineFile, Table]) -> None:
    """A tripod of half a millimetre is none: the drawing is in another unit, and not every length of the run."""
    file, table = sound
    names = ("base_radius_mm", "platform_radius_mm", "link_length_mm")
    metres = {name: 1e-3 * getattr(file.machine, name) for name in names}
    travel = tuple((1e-3 * low, 1e-3 * high) for low, high in file.machine.travel_ends)
    small = replace(file, machine=file.machine.model_copy(update={**metres, "slider_travel_mm": travel}))
    found = check_setup(small, table)
    assert [finding.mistake for finding in found.sure] == ["unit-scale"]
    assert "the machine file's lengths taken as metres" in found.sure[0].words
    assert found.file.machine.link_length_mm == pytest.approx(file.machine.link_length_mm)
    np.testing.assert_allclose(found.file.machine.travel_ends, file.machine.travel_ends)


def test_without_readings_only_what_is_asked_holds_together(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    said = str(check_setup(file, table.replace(measured=np.full((table.rows, 3), np.nan))))
    assert said == f"there are no readings; what is asked of the machine holds together ({table.rows} rows)"


def test_azimuths_in_radians() -> None:
    file, table = load_machine(DATA / "machine.toml"), read_table(DATA / "run.csv")
    spec = file.machine.model_copy(update={"slider_azimuth_deg": (0.0, 2.0943951, 4.1887902)})
    (only,) = check_setup(replace(file, machine=spec), table).findings
    assert only.mistake == "angle-unit" and "[0.0, 120.0, 240.0]" in only.fix


def test_what_nothing_explains_does_not_hold_together(sound: tuple[MachineFile, Table]) -> None:
    """The readings of some other run: no known mistake, and no word of a set-up that holds."""
    file, table = sound
    other = np.random.default_rng(4).uniform(-80.0, 80.0, table.measured.shape)
    found = check_setup(file, table.replace(measured=other))
    assert found.ok and "no machine is built so far off" in str(found)
    assert "holds together" not in str(found)
    assert check_setup(file, table).to_dict()["unexplained"] is None


def test_readings_that_are_far_off_in_a_part_of_the_run_alone_are_said() -> None:
    """Two sliders change places for a third of a run: the others agree, and hide it from any mean. Rows are lines."""
    file, table = draw_run(2, rows=90)
    assert table.command is not None
    row = np.arange(table.rows)
    there = (row >= 40) & (row < 70)
    other = np.where(there[:, None], table.command[:, [1, 0, 2]], table.command)
    found = check_setup(file, table.replace(target=np.full_like(table.target, np.nan), command=other))
    assert not found.findings and "between rows 42 and 71, are off the commands" in str(found)
    few = np.where((row < 3)[:, None], table.measured + 20.0, table.measured)  # gross errors
    assert check_setup(file, table.replace(measured=few)).to_dict()["unexplained"] is None


def test_poses_that_match_in_two_ways_are_named_and_left_alone() -> None:
    """A cube of poses looks the same from four sides: the order is wrong, and no reading can tell which is right."""
    file, table = draw_run(2, rows=100)
    grid = np.stack(np.meshgrid(*[np.linspace(-30.0, 30.0, 3)] * 3), axis=-1).reshape(-1, 3)
    cube = take_rows(table, np.arange(len(grid))).replace(target=grid, command=None, std=None)
    mixed = cube.replace(measured=np.random.default_rng(1).permutation(grid) + 500.0)
    found = check_setup(file, mixed)
    assert [item.mistake for item in found.sure] == ["row-order"] and "several ways alike" in found.sure[0].words
    np.testing.assert_array_equal(found.table.measured, mixed.measured)  # type: ignore[union-attr]


def test_sliders_in_another_order_are_shown_first_and_may_be_gone_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], sound: tuple[MachineFile, Table]
) -> None:
    """Commands that contradict the targets: compare still compares, and `add --anyway` goes on by the commands."""
    _, table = sound
    assert table.command is not None
    write_table(table.replace(command=table.command[:, [1, 0, 2]]), tmp_path / "run.csv")
    given = (tmp_path / "run.csv", "--model", DATA / "machine.toml", "--json")
    assert run_verb("compare", *given) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["setup"][0]["mistake"] == "slider-order"
    assert data["rms_um"]["total"] > 1000.0
    words = ("backlash", *given[1:], "--out", tmp_path / "out.toml")
    assert run_verb("add", given[0], *words) == 3
    assert run_verb("add", given[0], *words, "--anyway") == 0


@pytest.mark.parametrize("stated", ["sigma_mm", "std"])
def test_noise_in_um_shows_without_repeats(stated: str) -> None:
    file, table = draw_run(20_003, faults=1, rows=60)
    once = np.unique(np.round(table.target, 6), axis=0, return_index=True)[1]
    table = take_rows(table, np.sort(once))
    sigma = {"sigma_mm": 4.0} if stated == "sigma_mm" else {}
    file = replace(file, tracker=file.tracker.model_copy(update=sigma))
    table = table if sigma else table.replace(std=np.full((table.rows, 3), 4.0))
    found = check_setup(file, table)
    assert [item.mistake for item in found.findings] == ["noise-implausible"] and not found.ok
    cured = found.file.tracker.sigma_mm if sigma else float(found.table.std[0, 0])
    assert cured == pytest.approx(0.004)
    fair = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": 0.15}))
    assert check_setup(fair, table.replace(std=None)).ok


def test_files_of_two_stations_are_named_where_the_machine_file_says_nothing_of_a_tracker(
    sound: tuple[MachineFile, Table], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bare = "\n".join(line for line in (DATA / "machine.toml").read_text().partition("[tracker]")[0].splitlines())
    (tmp_path / "m.toml").write_text(f"{bare}\n")
    for name, shift in (("a.csv", 0.0), ("b.csv", 500.0)):
        write_table(sound[1].replace(measured=sound[1].measured + np.array([shift, 0.0, 0.0])), tmp_path / name)
    arguments = [tmp_path / "a.csv", "--also", tmp_path / "b.csv", "--model", tmp_path / "m.toml", "--json"]
    assert run_verb("check", *arguments) == 0
    (found,) = json.loads(capsys.readouterr().out)["findings"]
    assert found["sure"] and "the tracker stood elsewhere in" in found["words"]


def test_std_columns_of_zeros_are_said_to_say_nothing(sound: tuple[MachineFile, Table]) -> None:
    file, table = sound
    found = check_setup(file, table.replace(std=np.zeros((table.rows, 3))))
    (said,) = found.findings
    assert said.mistake == "noise-implausible" and "taken as not stated" in said.words and found.ok
