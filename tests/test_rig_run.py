"""Runs of the rig: rows, columns, files, repeatable bytes, and clear words about a rig that cannot be."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from test_rig_bench import BENCH, COMMAND, MEASURED, TARGET, bench, table, volume

from ptt.errors import InputError, TableError
from ptt.rig import format_rig, load_rig, parse_rig, simulate, write_run
from ptt.run.reading import read_table

POSES = volume(6)
LAW = {"kind": "random-law", "place": "along", "leg": 1, "form": "smooth", "variables": ["b1"], "size_um": 5.0}
RICH = {
    "seed": 3,
    "drive": {"backlash_mm": 0.05, "turn_um": 4.0, "homing_mm": [0.2, -0.1, 0.3], "compliance_um_per_n": 0.2},
    "geometry": {"straightness_um": 8.0, "platform_axis_radial_mrad": [0.3, 0.0, -0.2]},
    "conditions": {"cycles": 2, "payload_per_cycle_kg": [0.0, 3.0], "room": {"rise_k": 2.0}},
    "thermal": {"growth_um_per_m_k": 11.5, "screw_lag_s": 300.0, "sensor_sigma_k": 0.05},
    "tracker": {"wander_um": 1.0, "outlier_share": 0.1, "missing_share": 0.1, "datum_every": 4},
    "odd": [{"kind": "hose", "anchor_mm": [300.0, 0.0, 100.0], "pull_n": 5.0}],
}


def test_rows_columns_and_context() -> None:
    frame = simulate(bench(**RICH), table(POSES)).frame
    context = ["name", "role", "run", "repeat", "time_s", "payload_kg", "temp_c", "feed_mm_s"]
    assert list(frame) == [*context, *TARGET, *COMMAND, *MEASURED]
    assert frame["role"].tolist() == (["pose"] * 4 + ["datum"] + ["pose"] * 2) * 2
    assert frame["repeat"].tolist() == [1] * 7 + [2] * 7
    assert frame["payload_kg"].tolist() == [0.0] * 7 + [3.0] * 7
    assert (np.diff(frame["time_s"]) > 0).all()
    assert frame["temp_c"].iloc[-1] > frame["temp_c"].iloc[0]
    assert frame.loc[4, TARGET].tolist() == [0.0, 0.0, 0.0]


def test_time_is_travel_and_dwell() -> None:
    poses = np.array([[0.0, 0.0, 0.0], [30.0, 40.0, 0.0], [30.0, 40.0, 10.0]])
    rows = table(poses).assign(feed_mm_s=[10.0, 10.0, 5.0])
    standing = simulate(bench(conditions={"dwell_s": 3.0}), rows, noise=False).frame["time_s"]
    np.testing.assert_allclose(np.diff(standing), [8.0, 5.0])
    moving = simulate(bench(conditions={"dwell_s": 3.0, "moving": True}), rows, noise=False).frame["time_s"]
    np.testing.assert_allclose(np.diff(moving), [5.0, 2.0])


def test_bytes_repeat_and_seeds_differ(tmp_path: Path) -> None:
    for name, seed in (("a", None), ("b", None), ("c", 4)):
        write_run(simulate(bench(**RICH), table(POSES), seed=seed).frame, tmp_path / name)
    first, again, other = ((tmp_path / name).read_bytes() for name in "abc")
    assert first == again
    assert first != other
    assert {path.name for path in tmp_path.iterdir()} == set("abc")  # no temporary file is left behind


def test_another_seed_is_the_same_machine() -> None:
    one, two = (simulate(bench(**RICH), table(POSES), seed=seed) for seed in (1, 2))
    np.testing.assert_array_equal(one.truth, two.truth)
    assert np.nanmax(np.abs(one.frame[MEASURED].to_numpy() - two.frame[MEASURED].to_numpy())) > 1e-3


def test_file_reads_back_exactly(tmp_path: Path) -> None:
    frame = simulate(bench(**RICH), table(POSES)).frame
    write_run(frame, tmp_path / "run.csv")
    back = read_table(tmp_path / "run.csv")
    np.testing.assert_array_equal(back.measured, frame[MEASURED].to_numpy())
    np.testing.assert_array_equal(back.target, frame[TARGET].to_numpy())
    np.testing.assert_array_equal(back.command, frame[COMMAND].to_numpy())
    np.testing.assert_array_equal(back.time_s, frame["time_s"].to_numpy())
    assert back.role.tolist() == frame["role"].tolist()


def test_sliders_are_sent_and_targets_stay() -> None:
    rig = bench()
    nominal = simulate(rig, table(POSES), noise=False).frame[COMMAND].to_numpy()
    sliders = pd.DataFrame(nominal + 0.5, columns=["b1", "b2", "b3"]).assign(status="ok", reversal1=0.0)
    result = simulate(rig, table(POSES), sliders=sliders, noise=False)
    np.testing.assert_allclose(result.slider_actual, nominal + 0.5, atol=1e-12)
    np.testing.assert_allclose(result.truth, POSES + np.array([0.0, 0.0, 0.5]), atol=1e-9)
    np.testing.assert_array_equal(result.frame[TARGET], POSES)
    np.testing.assert_array_equal(result.frame[COMMAND], nominal + 0.5)
    assert "status" not in result.frame


def test_sliders_for_one_cycle_or_for_all() -> None:
    rig = bench(conditions={"cycles": 3})
    nominal = simulate(bench(), table(POSES), noise=False).frame[COMMAND].set_axis(["b1", "b2", "b3"], axis=1)
    one = simulate(rig, table(POSES), sliders=nominal + 0.1, noise=False)
    whole = simulate(rig, table(POSES), sliders=pd.concat([nominal + 0.1] * 3), noise=False)
    np.testing.assert_array_equal(one.truth, whole.truth)
    with pytest.raises(TableError, match="5 rows of sliders for 6 targets"):
        simulate(rig, table(POSES), sliders=nominal[:5])
    with pytest.raises(TableError, match="column b1 is missing"):
        simulate(rig, table(POSES), sliders=nominal.drop(columns="b1"))
    hole = nominal.copy()
    hole.loc[2, "b2"] = np.nan
    with pytest.raises(TableError, match="sliders row 3: has no b1, b2, b3 to send"):
        simulate(rig, table(POSES), sliders=hole)


def test_forces_and_directions_on_request() -> None:
    rig = bench(conditions={"report_force": True, "report_direction": True, "payload_kg": 2.0})
    frame = simulate(rig, table(POSES), noise=False).frame
    assert set(np.unique(frame[["dir1", "dir2", "dir3"]])) <= {-1.0, 1.0}
    step = np.sign(np.diff(frame[COMMAND].to_numpy(), axis=0))
    np.testing.assert_array_equal(frame[["dir1", "dir2", "dir3"]].to_numpy()[1:], step)
    np.testing.assert_array_equal(frame[["dir1", "dir2", "dir3"]].to_numpy()[0], step[0])
    np.testing.assert_allclose(frame[["tau1", "tau2", "tau3"]].sum(axis=1), -2.0 * 9.80665, atol=1e-9)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (pd.DataFrame(columns=TARGET), "targets: has no rows"),
        (pd.DataFrame({"x_cmd": [1.0], "y_cmd": [1.0]}), "column z_cmd is missing"),
        (pd.DataFrame([[1.0, 2.0, np.nan]], columns=TARGET), "row 1 has neither x_cmd"),
        (pd.DataFrame([[1.0, 2.0, 3.0], [1.0, "up", 2.0]], columns=TARGET), "row 2, column y_cmd: not a number"),
        (table(POSES).assign(feed_mm_s=[5.0, np.nan, 0.0, 1.0, 1.0, 1.0]), "row 3, column feed_mm_s: a feed of 0 mm/s"),
    ],
)
def test_bad_targets(rows: pd.DataFrame, message: str) -> None:
    with pytest.raises(TableError, match=message):
        simulate(bench(), rows)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"drive": {"backlsh_mm": 0.1}}, r"unknown key 'backlsh_mm'; did you mean 'backlash_mm'\? \(in drive\)"),
        ({"drvie": {}}, "unknown key 'drvie'; did you mean 'drive'"),
        ({"drive": {"backlash_mm": [0.1, 0.2]}}, r"key drive.backlash_mm"),
        ({"drive": {"backlash_mm": "much"}}, r"key drive.backlash_mm.*found 'much'"),
        ({"odd": [{"kind": "gremlin"}]}, "gremlin"),
        ({"odd": [{"kind": "splice", "leg": 4, "height_mm": 1.0, "step_um": 1.0}]}, "less than or equal to 3"),
        ({"tracker": {"knock_row": 3, "knock_time_s": 4.0}}, "knock_row and knock_time_s are both given"),
        ({"tracker": {"knock_um": [9.0, 0.0, 0.0]}}, "knock_um without a moment.*give knock_row or knock_time_s"),
        ({"drive": {"slip_mm": [0.1, 0.0, 0.0]}}, "slip_mm without a moment.*give slip_row or slip_time_s"),
        ({"drive": {"map_height_mm": [1.0, 2.0], "map_um": [[1.0, 2.0]] * 3}}, "drive.map_um.*at least 4"),
        ({"drive": {"map_height_mm": [1.0, 3.0, 3.0, 4.0], "map_um": [[1.0] * 4] * 3}}, "map_height_mm.*have to rise"),
        ({"geometry": {"straightness_height_mm": [4.0, 3.0, 2.0, 1.0]}}, "straightness_height_mm.*have to rise"),
        ({"drive": {"curve_span_mm": [200.0, 200.0]}}, "curve_span_mm.*ends of a span are the same"),
        ({"geometry": {"straightness_span_mm": [200.0, 200.0]}}, "straightness_span_mm.*ends of a span are the same"),
        ({"odd": [{"kind": "cable-drag", "leg": 1, "low_mm": 2, "high_mm": 2, "size_um": 5}]}, "are the same"),
        ({"odd": [{**LAW, "span": [[1.0, 1.0]]}]}, "span.*are the same"),
        ({"drive": {"backlash_mm": [0.1, -0.1, 0.0]}}, "drive.backlash_mm.*greater than or equal to 0"),
        ({"odd": [{"kind": "load-backlash", "leg": 1, "gap_um_per_kg": -5.0}]}, "greater than or equal to 0"),
        ({"conditions": {"cycles": 0}}, "greater than or equal to 1"),
    ],
)
def test_bad_rigs(content: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        parse_rig({"machine": BENCH, **content}, "my.toml")
    assert caught.value.exit_code == 2
    assert str(caught.value).startswith("my.toml")
    assert "\n" not in str(caught.value)


def test_bad_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a machine file; name a rig"):
        load_rig(Path(__file__).resolve().parents[1] / "data" / "machine.toml")
    with pytest.raises(InputError, match="no such file"):
        load_rig(tmp_path / "none.toml")
    (tmp_path / "broken.toml").write_text("machine = ")
    with pytest.raises(InputError, match="not valid TOML"):
        load_rig(tmp_path / "broken.toml")


def test_machine_is_found_beside_the_rig(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    lines = "\n".join(f"{key} = {value!r}".replace("'", '"') for key, value in BENCH.items())
    (tmp_path / "m.toml").write_text(f"[machine]\n{lines}\n")
    (tmp_path / "deep" / "rig.toml").write_text('machine = "../m.toml"\nseed = 4\n')
    rig = load_rig(tmp_path / "deep" / "rig.toml")
    assert (rig.seed, rig.spec.base_radius_mm) == (4, 200.0)


def test_rig_text_round_trip() -> None:
    rig = bench(**RICH)
    assert parse_rig(format_rig(rig)) == rig


def test_every_key_of_a_rig_is_documented() -> None:
    from ptt.rig import arm_odd_schema, odd_schema, schema

    text = (Path(__file__).resolve().parents[1] / "data" / "README.md").read_text(encoding="utf-8")
    named = (*vars(schema).values(), *vars(odd_schema).values(), *vars(arm_odd_schema).values())
    sections = [item for item in named if isinstance(item, type) and issubclass(item, schema.Section)]
    missing = [key for section in sections for key in section.model_fields if key not in text]
    assert missing == []


def test_a_row_does_not_depend_on_how_many_follow() -> None:
    """Each row is solved for itself, whatever else is in the batch."""
    poses = volume(2000)
    long, short = (
        simulate(bench(**{**RICH, "conditions": {}}), table(part), noise=False).truth for part in (poses, poses[:30])
    )
    np.testing.assert_allclose(long[: len(short)], short, atol=1e-9)
