"""A user's own effect that starts from what a diagnosis found."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from ptt.challenge.cases import draw, plan
from ptt.challenge.challenge import bench
from ptt.challenge.remeasure import remeasure
from ptt.challenge.truth import table_of
from ptt.commands.main import app
from ptt.dependence.dependence import Dependence, of_run
from ptt.diagnosis.diagnose import diagnose
from ptt.effects import Curve
from ptt.effects.contract import check_effect
from ptt.effects.prefilled import is_variable, prefilled
from ptt.effects.registry import library, make_effect, parse_key
from ptt.errors import InputError, ModelError
from ptt.judge.ladder.climb import climb
from ptt.machine import load_machine
from ptt.model.chain import differentiate
from ptt.model.model import Model
from ptt.rig import parse_rig
from ptt.rig.draw import draw_rig
from ptt.rig.odd_schema import WarmBacklash
from ptt.rig.simulate import simulate, write_run
from ptt.run.problem import build_problem
from ptt.run.reading import read_table
from ptt.run.table import make_table
from ptt.run.viewing import build_view

RANGES = {name: [-50.0, 0.0, 50.0] if name in "xy" else [270.0, 283.0, 296.0] for name in ("b1", "b2", "b3", "x", "y")}
WARM = [20.0, 23.0, 26.0]
MACHINE = bench()
DATA = Path(__file__).resolve().parents[1] / "data"


def found(on: str, shape: str, **more: object) -> dict[str, object]:
    curve = {"at": RANGES.get(on, WARM), "mean_um": [0.0, 1.0, 2.0], "half_width_um": [1.0, 1.0, 1.0]}
    entry = {"residual": "slider 2", "on": on, "shape": shape, "curve": curve, "place": None, "period_mm": None}
    return entry | {"with": None} | more


@pytest.mark.parametrize("moments", [[30.0, 12.2], [30.0, 30.0], [np.inf], ["x"]])
def test_moments_that_are_none_are_refused(moments: list[object]) -> None:
    with pytest.raises(InputError, match="moments"):
        prefilled("own-cause", [found("time", "levels", residual="z", acts_on="z", moments=moments)])


def test_what_follows_the_feed_is_said_to(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="what follows the feed is not corrected"):
        prefilled("own-cause", [found("feed", "smooth")])


@pytest.mark.parametrize(
    "entry",
    [
        found("b2", "step", place=[270.0, 274.0]),
        found("b2", "bump", place=[270.0, 280.0]),
        found("b2", "bump", place=[970.0, 980.0]),
        found("time", "bump", acts_on="z", place=[9000.0, 9010.0]),
        found("time", "levels", residual="z", acts_on="z", moments=[30.0, 31.0, 7000.5]),
        found("b2", "period", period_mm=12.6),
        found("b2", "smooth"),
        found("x", "smooth"),
        found("direction1", "varying", **{"with": "temperature"}),
        found("payload", "levels"),
        found("temperature", "smooth"),
        found("speed3", "smooth"),
        found("b3", "smooth", acts_on="slider 2"),
        found("y", "smooth", acts_on="rail 2 outward"),
        found("b2", "step", place=[270.0, 274.0], acts_on="rail 2 sideways"),
        found("temperature", "smooth", acts_on="link 2"),
        found("b1", "smooth", residual="x", acts_on="x"),
        found("temperature", "smooth", residual="x"),
        found("direction1", "levels", residual="y", acts_on="y"),
        found("x", "smooth", residual="z", acts_on="z"),
        found("q2", "smooth", residual="x", acts_on="x"),
        found("x", "smooth", residual="joint 2", acts_on="joint 2"),
        found("direction2", "gradual", acts_on="slider 2", place=[240.0, 310.0], **{"with": "reversal"}),
        found("temperature", "smooth", residual="y", acts_on="set-up"),
        found("temperature", "smooth", residual="joint 2", acts_on="link 2"),
        found("time", "smooth", acts_on="slider 2", together=["time", "b2"], ranges=[[0.0, 900.0], [270.0, 296.0]]),
        found(
            "temperature",
            "smooth",
            acts_on="rail 2 outward",
            reference_c=21.0,
            together=["temperature", "b2"],
            ranges=[[20.0, 26.0], [270.0, 296.0]],
        ),
        found("z", "smooth", acts_on="joint 2", residual="joint 2", together=["x", "y", "z"], ranges=3 * [[-9.0, 9.0]]),
        found(
            "time",
            "step",
            residual="z",
            acts_on="z",
            place=[30.0, 31.0],
            together=["time", "x", "y", "z"],
            ranges=[[0.0, 900.0], *3 * [[-90.0, 90.0]]],
        ),
    ],
    ids=lambda entry: f"{entry['on']}-{entry['shape']}-{entry.get('acts_on', '')}",
)
def test_every_shape_makes_an_effect_that_keeps_the_contract(tmp_path: Path, entry: dict[str, object]) -> None:
    path = tmp_path / "own.py"
    path.write_text(prefilled("own-cause", [entry]).text)
    (cls,) = (cls for name, cls in library(path).items() if name == "own-cause")
    broken = [f"{item.check}: {item.broken}" for item in check_effect(cls(), differentiate) if not item.passed]
    assert not broken


def test_what_takes_several_variables_is_written_as_a_field_of_them(tmp_path: Path) -> None:
    """A slider that moves with time, more the higher it stands, which no curve over one of the two describes."""
    path = tmp_path / "own.py"
    several = {"together": ["time", "b2"], "ranges": [[0.0, 900.0], [270.0, 296.0]]}
    path.write_text(prefilled("own-cause", [found("time", "smooth", acts_on="slider 2", **several)]).text)
    effect = library(path)["own-cause"]()
    random = np.random.default_rng(4)
    table = make_table(
        random.uniform([-40.0, -40.0, 10.0], [40.0, 40.0, 50.0], (200, 3)), time_s=np.linspace(0, 900, 200)
    )
    view = build_view(MACHINE, table)
    basis = effect.basis(view, {})[:, 1].numpy()
    time, height = view.time.numpy() / 450.0 - 1.0, (view.q[:, 1].numpy() - 283.0) / 13.0
    held = np.clip(height, -1.0, 1.0)
    for wanted in (np.ones(200), time * held, time**2 * held**3):
        left = wanted - basis @ np.linalg.lstsq(basis, wanted, rcond=None)[0]
        assert np.abs(left).max() < 1e-9
    assert (np.abs(height) > 1.0).any(), "beyond its range it stays as at the end"
    assert not effect.basis(view, {})[:, [0, 2]].any()


def test_an_unknown_of_two_variables_is_taken_away_by_the_field_that_is_written(tmp_path: Path) -> None:
    """A slider off by a random function of time and height: over time alone 57 % of the tool's error go."""
    (case,) = plan("unknown", 1, 6066, bench=None, visible=True)
    drawn, _ = draw(case)
    problem = build_problem(drawn.rig.machine, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    told = diagnose(Model(drawn.rig.machine), problem)
    first = told.depends_on[0]
    assert (first.residual, first.together) == ("slider 1", ("time", "b1"))
    time, height = problem.view.clock[problem.used], problem.view.q[problem.used][:, 0]
    for (low, high), values in zip(first.ranges, (time, height), strict=True):  # but for a few rows set aside
        assert values.min() <= low < high <= values.max() and high - low > 0.9 * (values.max() - values.min())
    path = tmp_path / "own.py"
    path.write_text(prefilled("own-cause", told.to_dict()["depends_on"]).text)
    tool = remeasure(climb(told.model, problem, [library(path)["own-cause"]()]).model, drawn).to_dict()
    assert tool["after"] is not None and tool["after"]["total"] < 0.3 * tool["before"]["total"]


def test_a_field_of_a_slider_of_which_its_own_travel_shows_most_is_written_at_the_slider(tmp_path: Path) -> None:
    path, ranges = tmp_path / "own.py", [[-40.0, 40.0], [-30.0, 30.0], [10.0, 50.0]]
    entry = found("b2", "smooth", acts_on=None, together=["x", "y", "z"], ranges=ranges, alone_share=0.4)
    path.write_text(prefilled("own-cause", [entry]).text)
    effect = library(path)["own-cause"]
    assert (effect.on, effect.acts_on, effect.together) == ("x", "slider 2", ("x", "y", "z"))
    assert "follows x, y and z together" in path.read_text()
    assert all(item.passed for item in check_effect(effect(), differentiate))


@pytest.mark.parametrize(
    "several",
    [
        {"together": ["time", "b2"], "ranges": [[0.0, 900.0], [296.0, 270.0]]},
        {"together": ["time", "time"], "ranges": 2 * [[0.0, 900.0]]},
        {"together": ["time", "b2"], "ranges": ["x", "y"]},
    ],
)
def test_ranges_that_are_none_are_refused(several: dict[str, object]) -> None:
    with pytest.raises(InputError, match="ranges"):
        prefilled("own-cause", [found("time", "smooth", acts_on="slider 2", **several)])


@pytest.mark.parametrize(
    "several", [{}, {"ranges": [[0.0, 1.0]]}, {"together": ["time", "feed"], "ranges": 2 * [[0.0, 1.0]]}]
)
def test_a_field_that_no_effect_can_read_is_written_along_its_leading_variable(several: dict[str, object]) -> None:
    text = prefilled("own-cause", [found("time", "smooth", acts_on="slider 2", together=["time", "b2"]) | several]).text
    assert "together" not in text and 'on, shape = "time", "smooth"' in text


@pytest.mark.parametrize(
    ("entry", "kinds"),
    [
        (found("payload", "levels"), {"three-ptt"}),
        (found("payload", "levels", residual="joint 2"), {"serial"}),
        (found("payload", "levels", residual="x"), {"three-ptt", "serial"}),
        (found("direction1", "levels", residual="y", acts_on="y"), {"three-ptt", "serial"}),
        (found("direction1", "levels", residual="y"), {"three-ptt"}),
        (found("b1", "smooth", residual="x", acts_on="x"), {"three-ptt"}),
        (found("q2", "smooth", residual="x", acts_on="x"), {"serial"}),
    ],
)
def test_what_is_of_the_tool_alone_fits_arms_as_well(tmp_path: Path, entry: dict[str, object], kinds: set[str]) -> None:
    path = tmp_path / "own.py"
    path.write_text(prefilled("own-cause", [entry]).text)
    assert set(library(path)["own-cause"].mechanisms) == kinds


@pytest.mark.parametrize(
    ("place", "follows", "law"),
    [
        pytest.param(
            "slider 1",
            "b3",
            {"kind": "cross-coupling", "leg": 1, "other": 3, "height_mm": 290.0, "span_mm": 60.0},
            marks=pytest.mark.long,
        ),
        ("rail 2 outward", "b1", {"place": "radial", "leg": 2, "variables": ["b1"], "span": [[200.0, 400.0]]}),
        pytest.param(
            "link 3",
            "x",
            {"place": "link", "leg": 3, "variables": ["x"], "span": [[-60.0, 60.0]]},
            marks=pytest.mark.long,
        ),
        ("y", "x", {"place": "tool-y", "variables": ["x"], "span": [[-60.0, 60.0]]}),
    ],
)
def test_a_written_effect_acts_where_the_unknown_does(
    tmp_path: Path, place: str, follows: str, law: dict[str, object]
) -> None:
    drawn = {"size_um": 40.0} | ({} if "kind" in law else {"kind": "random-law", "form": "smooth", "law_seed": 5})
    rig = parse_rig({"machine": MACHINE.machine.model_dump(), "seed": 3, "odd": [{**law, **drawn}]})
    random = np.random.default_rng(3)
    cloud = pd.DataFrame(random.uniform(-60.0, 60.0, (150, 3)).round(3), columns=["x_cmd", "y_cmd", "z_cmd"])
    frame = simulate(rig, cloud, noise=False).frame
    frame[["x_meas", "y_meas", "z_meas"]] += random.normal(0.0, 0.005, (150, 3))
    problem = build_problem(MACHINE, table_of(frame))
    found = diagnose(Model(MACHINE), problem).to_dict()
    first = found["depends_on"][0]
    said = {"rail 2 outward": "as if rail 2 moved outward", "link 3": "as if link 3 changed its length"}
    assert said.get(place, "depends on") in found["words"]
    assert (first["acts_on"], first["on"]) == (place, follows)
    assert first["share"] > 0.7  # of its variance: its level, which a frame may take as well, is no part of that
    path = tmp_path / "own.py"
    path.write_text(prefilled("own-cause", [first]).text)
    ladder = climb(Model(MACHINE), problem, [make_effect(library(path), "own-cause")])
    assert ladder.steps[0].heldout_rms_um["total"] > 1.8 * 5.0 * 3**0.5
    assert ladder.steps[-1].heldout_rms_um["total"] < 1.2 * 5.0 * 3**0.5  # of the readings' own scatter


@pytest.mark.long
def test_a_play_that_opens_when_warm_is_described_by_the_file_as_written(tmp_path: Path) -> None:
    drawn = draw_rig(400, MACHINE, "warmup")
    growth = {"frame_um_per_m_k": 15.9, "link_um_per_m_k": 3.7, "sensor": "frame"}
    growth |= {"growth_um_per_m_k": (11.1, 11.1, 11.1), "fixed_end_mm": (150.0, 150.0, 150.0)}
    play = WarmBacklash(kind="warm-backlash", leg=3, gap_um_per_k=14.3, opens_at_c=22.6)
    rig = replace(drawn.rig, thermal=drawn.rig.thermal.model_copy(update=growth), odd=(play,))
    run, file, diagnosis = tmp_path / "run.csv", tmp_path / "play.py", tmp_path / "found.json"
    write_run(simulate(rig, drawn.targets).frame, run)
    problem = build_problem(MACHINE, read_table(run))
    result = diagnose(Model(MACHINE), problem)
    assert result.verdict == "unknown"
    assert result.depends_on[0].with_ == "temperature"
    diagnosis.write_text(json.dumps(result.to_dict()))
    outcome = CliRunner().invoke(app, ["effects", "new", "warm-play", "--like", str(diagnosis), "--out", str(file)])
    assert outcome.exit_code == 0, outcome.output
    own = library(file)
    ladder = climb(Model(MACHINE), problem, [make_effect(own, "warm-play")])
    assert ladder.steps[-1].heldout_rms_um["total"] < 0.3 * ladder.steps[0].heldout_rms_um["total"]
    rest = diagnose(ladder.model, problem, own)  # what was hidden beside it shows once it is said
    assert rest.verdict == "missing" and {step[0] for step in rest.suggested} <= {"frame-growth", "screw-growth"}
    whole = climb(ladder.model, problem, [make_effect(own, *parse_key(step[0])) for step in rest.suggested])
    assert whole.steps[-1].heldout_rms_um["total"] < 1.25 * whole.noise_um["total"]


def test_what_is_no_diagnosis_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "found.json"
    path.write_text('{"depends_on": []}')
    outcome = CliRunner().invoke(app, ["effects", "new", "own-cause", "--like", str(path)])
    assert outcome.exit_code == 2
    path.write_text("[1, 2]")
    assert CliRunner().invoke(app, ["effects", "new", "own-cause", "--like", str(path)]).exit_code == 2
    for broken in ('{"depends_on": 5}', '{"depends_on": ["abc"]}', "nothing"):
        path.write_text(broken)
        assert CliRunner().invoke(app, ["effects", "new", "own-cause", "--like", str(path)]).exit_code == 2
    with pytest.raises(InputError, match="residual"):
        prefilled("own-cause", [{"on": "b2", "shape": "smooth"}])
    for hostile in (found('b2"""\nprint()', "smooth"), found("b2", "smooth", residual='x"""\nprint()')):
        with pytest.raises(InputError, match="proper"):
            prefilled("own-cause", [hostile])
    with pytest.raises(InputError, match="acts_on"):
        prefilled("own-cause", [found("b2", "smooth", acts_on="rail 2")])
    for nowhere in ("rail 9 outward", "link 7", "slider 5", "joint 2"):
        with pytest.raises(InputError, match="acts_on"):
            prefilled("own-cause", [found("b2", "smooth", acts_on=nowhere)])
        with pytest.raises(TypeError, match="cannot act"):
            type("Nowhere", (Curve,), {"mechanisms": ("three-ptt",), "on": "b2", "acts_on": nowhere})
    with pytest.raises(InputError, match="acts_on"):
        prefilled("own-cause", [found("q2", "smooth", residual="joint 2", acts_on="rail 1 outward")])
    with pytest.raises(InputError, match="'on'"):
        prefilled("own-cause", [found("b9", "smooth")])
    with pytest.raises(InputError, match="shape"):
        prefilled("own-cause", [found("b2", "gradual")])
    with pytest.raises(InputError, match="place"):
        prefilled("own-cause", [found("b2", "step", place=["high", "low"])])


def test_each_thing_that_the_error_follows_has_a_law(tmp_path: Path) -> None:
    step = found("b2", "step", place=[270.0, 274.0], acts_on="rail 2 outward")
    unread = found("way z", "smooth", residual="z")
    diagnosis, file = tmp_path / "found.json", tmp_path / "own.py"
    diagnosis.write_text(json.dumps({"depends_on": [unread, step, found("b3", "smooth"), step]}))
    words = ["effects", "new", "own-cause", "--like", str(diagnosis), "--out", str(file), "--json"]
    told = json.loads(CliRunner().invoke(app, words).stdout)
    assert told["names"] == ["own-cause", "own-cause-2"] and "cannot read 'way z'" in told["left_out"][0]
    own = library(file)
    assert [own[name].on for name in told["names"]] == ["b2", "b3"]
    assert "# left out:" in file.read_text() and file.read_text() == told["text"]
    with pytest.raises(InputError, match="way z"):
        prefilled("own-cause", [unread])


def test_on_an_arm_it_acts_on_the_joint_in_rad(tmp_path: Path) -> None:
    text = prefilled("own-cause", [found("direction2", "levels", residual="joint 2")]).text
    assert 'mechanisms = ("serial",)' in text
    path = tmp_path / "own.py"
    path.write_text(text)
    (parameter,) = library(path)["own-cause"].parameters
    assert parameter.unit == "rad"


def test_a_curve_reaches_to_the_ends_of_what_was_visited() -> None:
    """Not to the middles of its outermost bins: what settles is steepest before the first of them."""
    settles = found("time", "smooth", curve={"at": [50.0, 150.0, 250.0, 400.0], "between": [3.0, 480.0]})
    assert "between = (3, 480)" in prefilled("own-cause", [settles]).text
    older = found("time", "smooth", curve={"at": [50.0, 150.0, 250.0, 400.0]})
    assert "between = (50, 400)" in prefilled("own-cause", [older]).text


def test_temperatures_are_taken_from_the_reference() -> None:
    assert "between = (2, 2.4)" in prefilled("own-cause", [found("temperature", "step", place=[22.0, 22.4])]).text


@pytest.mark.parametrize("own", [{"on": "q9", "acts_on": "joint 2"}, {"on": "q1", "acts_on": "joint 9"}])
def test_a_joint_that_an_arm_lacks_is_said(own: dict[str, str]) -> None:
    cls = type("Beyond", (Curve,), {"name": "beyond", "mechanisms": ("serial",), "between": (-1.0, 1.0), **own})
    assert cls().needs(SimpleNamespace(joints=6, varies=frozenset())) == "an arm of 9 joints"
    with pytest.raises(ModelError, match="asks for 9 joints, and the machine has 6"):
        Model(load_machine(DATA / "machines" / "ur10.toml")) + cls()


@pytest.mark.parametrize(("on", "offered"), [("b3", True), ("temperature", True), ("way y", False), ("coolant", False)])
def test_an_effect_is_offered_only_for_what_one_can_read(on: str, offered: bool) -> None:
    assert is_variable(on) == offered


@pytest.mark.parametrize("acts_on", ["rail 2 outward", "link 3", "y", ""])
def test_what_reverses_elsewhere_than_at_a_joint_is_added_and_measured(tmp_path: Path, acts_on: str) -> None:
    """A carriage that tips over as its drive pulls it the other way."""
    entry = found("direction2", "levels", residual="y" if acts_on in ("", "y") else "slider 2", acts_on=acts_on or None)
    path = tmp_path / "own.py"
    path.write_text(prefilled("own-cause", [entry]).text)
    drawn = draw_rig(5, MACHINE, "volume", rows=80)
    problem = build_problem(MACHINE, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    ladder = climb(Model(MACHINE), problem, [make_effect(library(path), "own-cause")])
    assert ladder.steps[-1].effect == "own-cause"


def test_warmth_is_reckoned_from_where_the_drawing_holds() -> None:
    """An entry says it; one of an older diagnosis stands for 20 C."""
    for reference, between in ((18.0, "(4, 8)"), (None, "(2, 6)")):
        entry = found("temperature", "smooth", curve={"at": [22.0, 26.0]}, reference_c=reference)
        assert f"between = {between}" in prefilled("own-cause", [entry]).text


@pytest.mark.parametrize(("on", "along", "reference"), [("temperature", None, 18.0), ("b1", "temperature", 18.0),
                                                        ("b1", "payload", None)])  # fmt: skip
def test_a_diagnosis_says_where_the_drawing_holds(on: str, along: str | None, reference: float | None) -> None:
    file = replace(MACHINE, machine=MACHINE.machine.model_copy(update={"reference_temp_c": 18.0}))
    drawn = draw_rig(5, MACHINE, "volume", rows=40)
    problem = build_problem(file, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    item = Dependence("slider 1", on, 0.9, 1e-9, None, "smooth", np.zeros((2, 3)), with_=along)
    assert of_run(item, problem).to_dict()["reference_c"] == reference


def test_what_follows_the_rows_of_a_run_without_a_clock_is_left_out_and_why() -> None:
    """No effect can be tested on the number of a row; what else the error follows is written."""
    rows = found("time", "smooth", unit="", by_rows=True)
    with pytest.raises(InputError, match=r"has no clock.*time_s"):
        prefilled("own-cause", [rows])
    written = prefilled("own-cause", [found("b1", "smooth"), rows])
    assert written.names == ("own-cause",) and "has no clock" in written.left_out[0] and "# left out" in written.text
    assert "time" in prefilled("own-cause", [found("time", "smooth", unit="s", by_rows=False)]).text


@pytest.mark.parametrize("on", ["time", "x"])
@pytest.mark.parametrize("clock", [True, False])
def test_a_diagnosis_says_where_its_time_is_the_number_of_the_row(on: str, clock: bool) -> None:
    drawn = draw_rig(5, MACHINE, "volume", rows=40)
    table = table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent)
    problem = build_problem(MACHINE, table.replace(time_s=np.arange(40.0) if clock else None))
    item = Dependence("x", on, 0.9, 1e-9, None, "smooth", np.zeros((2, 3)))
    assert of_run(item, problem).to_dict()["by_rows"] == (on == "time" and not clock)
    field = replace(item, on="x", together=("x", "time"))
    assert of_run(field, problem).to_dict()["by_rows"] == (not clock)


def test_what_acts_on_the_tool_may_be_the_trackers(tmp_path: Path) -> None:
    """Then commands leave it alone; a joint's own error is never the tracker's."""
    path = tmp_path / "own.py"
    text = prefilled("own-cause", [found("b1", "smooth", residual="y", acts_on="y")]).text
    path.write_text(text.replace('# stage = "metrology"', 'stage = "metrology"'))
    assert library(path)["own-cause"].stage == "metrology"
    path.write_text(text)
    assert library(path)["own-cause"].stage == "structure"
    assert "stage" not in prefilled("own-cause", [found("b1", "smooth", acts_on="slider 1")]).text
    with pytest.raises(TypeError, match="stage"):
        type("Own", (Curve,), {"mechanisms": ("three-ptt",), "on": "b1", "acts_on": "slider 1", "stage": "metrology"})


@pytest.mark.parametrize("shape", [{"shape": "bump", "place": [-0.7, 1.0]}, {"shape": "period", "period_mm": 9.0}])
def test_a_field_over_the_workspace_has_the_range_of_the_workspace(shape: dict[str, object]) -> None:
    """Scaled by the width of a bump, products of coordinates would be larger than any size."""
    text = prefilled("own-cause", [found("y", residual="z", **{"shape": "smooth"} | shape)]).text
    assert 'on, shape = "y", "smooth"' in text and "between = (-50, 50)" in text and "period" not in text
    on_the_tool = prefilled("own-cause", [found("y", residual="z", acts_on="z", **{"shape": "smooth"} | shape)]).text
    assert f'"{shape["shape"]}"' in on_the_tool
