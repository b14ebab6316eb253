"""Recheck on the virtual machine, which shares no equation with the model: same, changed, repaired, new, refused."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch

import ptt
from ptt.again.another import looks_like_another, values_say_another
from ptt.again.explanation import find_explanation
from ptt.again.news import look_for_news
from ptt.again.prior import build_prior
from ptt.again.recheck import recheck
from ptt.again.result import Recheck
from ptt.challenge.truth import table_of
from ptt.commands import main as commands
from ptt.effects import library
from ptt.errors import ModelError
from ptt.judge.history import record
from ptt.judge.ladder.climb import climb
from ptt.machine import format_machine, parse_machine, save_machine
from ptt.model.entries import read_model
from ptt.model.model import Model, Term
from ptt.model.of_run import for_runs
from ptt.rig import parse_rig, simulate
from ptt.rig.nominal import ideal_machine
from ptt.rig.targets import make_volume
from ptt.run.problem import Problem, build_problem
from ptt.run.written import write_table
from ptt.show.plots.recheck import bars_of, values_of

MACHINE = {"kind": "three-ptt", "base_radius_mm": 200, "platform_radius_mm": 100, "link_length_mm": 300,
           "slider_travel_mm": [150, 420], "screw_lead_mm": 5}  # fmt: skip
DATE = "2026-03-15T10:00:00+00:00"
GAPS, LINKS = (0.03, 0.02, 0.045), (0.08, -0.05, 0.0)
SIGMA = 0.004


def run_of(seed: int, rows: int = 80, room: tuple[float, ...] | None = None, **sections: dict) -> Problem:
    """A run of the machine with its faults, changed as said; path, tracker's place and noise by the seed."""
    random = np.random.default_rng(seed)
    tracker = {"white_mm": SIGMA, "translation_mm": random.uniform(-1, 1, 3).tolist(),
               "rotation_mrad": random.uniform(-1, 1, 3).tolist()}  # fmt: skip
    content = {"drive": {"backlash_mm": GAPS}, "geometry": {"link_mm": LINKS}, "tracker": tracker}
    for name, values in sections.items():
        content[name] = {**content.get(name, {}), **values}
    rig = parse_rig({"machine": MACHINE, "seed": seed, **content})
    half = () if room is None else (np.array(room),)
    table = table_of(simulate(rig, make_volume(ideal_machine(rig.spec), rows, seed, *half)).frame)
    file = parse_machine(f'{format_machine(rig.machine)}\n[tracker]\nframe = "fitted"\nsigma_mm = {SIGMA}\n')
    return build_problem(file, table)


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """The model of a first run, as its file keeps it."""
    return solve(run_of(1), ("backlash", "link-length"), tmp_path_factory.mktemp("solved"))


def solve(first: Problem, effects: tuple[str, ...], folder: Path) -> SimpleNamespace:
    write_table(first.table, folder / "first.csv")
    known = library()
    ladder = climb(Model(first.file), first, [known[name]() for name in effects])
    file = record(ladder, "add", [folder / "first.csv"], date=DATE)
    save_machine(file, folder / "solved.toml")
    save_machine(first.file, folder / "drawing.toml")
    return SimpleNamespace(model=read_model(parse_machine(format_machine(file))), folder=folder)


def look(solved: SimpleNamespace, problem: Problem) -> Recheck:
    model, _ = for_runs(solved.model, problem)
    return recheck(model, problem)


def test_a_sound_machine_is_the_same_with_another_set_up_path_and_noise(solved: SimpleNamespace) -> None:
    found = look(solved, run_of(2, conditions={"payload_kg": 3.0}))
    assert found.verdict == "same" and not found.changed
    assert abs(found.error_um["now"] / found.error_um["expected"] - 1.0) < 0.15
    assert max(abs(one.z) for one in found.parameters) < 4.5
    assert found.since == DATE and "15 March 2026" in found.words
    assert any("payload" in note and "3 kg" in note for note in found.notes)


def test_readings_that_scatter_far_more_than_the_model_left_are_said(solved: SimpleNamespace) -> None:
    """A joint that has come loose hides all else: nothing that the run could show has changed."""
    loud = replace(run_of(2, rows=160, tracker={"white_mm": 10.0 * SIGMA}), noise=None)
    found = look(solved, loud)
    (said,) = (note for note in found.notes if "come loose" in note)
    assert f"the noise of this run is {found.noise_um['total']:.1f} um" in said
    assert not any("come loose" in note for note in look(solved, run_of(2)).notes)


def test_only_the_value_that_changed_is_named_with_its_side_unit_and_true_size(solved: SimpleNamespace) -> None:
    found = look(solved, run_of(3, drive={"backlash_mm": (0.03, 0.045, 0.045)}))
    assert found.verdict == "changed"
    (change,) = found.changed
    assert (change.moved.effect, change.moved.name, change.moved.joint) == ("backlash", "gap_mm 2", 2)
    step = change.moved.now - change.moved.before
    assert abs(step - 0.025) < 4.0 * change.moved.std < 0.01
    assert change.moved.z == pytest.approx(step / change.moved.std)
    assert "Slider 2 loses 4" in change.words and "more than on 15 March 2026" in change.words
    assert found.error_um["left"] < found.error_um["now"]
    np.testing.assert_allclose(found.model.terms[0].theta.numpy()[1], 0.045, atol=0.004)


def test_what_the_last_fit_could_not_test_is_as_uncertain_as_before(solved: SimpleNamespace, monkeypatch) -> None:
    """A model refitted to a run that cannot test its play: the play is not known any better for that."""
    with monkeypatch.context() as now:
        now.setattr(type(library()["backlash"]()), "needs", lambda self, view: "both directions of arrival")
        ladder = climb(solved.model, run_of(5), [])
    again = read_model(parse_machine(format_machine(record(ladder, "fit", [solved.folder / "first.csv"]))))
    prior = build_prior(again, run_of(2))
    stated = next(t.std[:3].numpy() for t in solved.model.terms if t.effect.name == "backlash")
    play = [place for place, name in enumerate(prior.layout.names) if name.startswith("backlash gap")]
    np.testing.assert_allclose(prior.std[play] * prior.layout.scale[play], stated, rtol=1e-3)


def test_of_a_long_run_stretches_are_looked_at_and_the_change_is_the_same(solved, monkeypatch) -> None:
    problem = run_of(3, drive={"backlash_mm": (0.03, 0.045, 0.045)})
    monkeypatch.setattr("ptt.again.recheck.WHOLE", 60)
    monkeypatch.setattr("ptt.again.recheck.sample_stretches", lambda problem, rows: [(0, 35), (40, 78)])
    found = look(solved, problem)
    assert found.rows < problem.table.rows and any("stretches" in note for note in found.notes)
    assert [item.moved.name for item in found.changed] == ["gap_mm 2"]


def test_a_repair_is_called_one_and_says_what_is_left(solved: SimpleNamespace) -> None:
    found = look(solved, run_of(4, drive={"backlash_mm": (0.0, 0.0, 0.0)}))
    assert found.verdict == "changed"
    assert {item.moved.effect for item in found.changed} == {"backlash"}
    assert all(item.repaired for item in found.changed) and "Repaired" in found.words
    assert found.made_um["now"]["backlash"] < 0.1 * found.made_um["before"]["backlash"]
    assert " on reversal in the model of " in found.words or "as a whole" in found.words
    assert set(found.made_um["now"]) == {"total", *(term.effect.key for term in found.model.terms)}
    assert all(found.to_dict()["made_um"]["before"])  # no key without a name
    assert "The repair helped" in found.words and "link-length" in found.words.partition("The repair helped")[2]


@pytest.fixture(scope="module")
def homed(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """The model of a first run with a slider that was homed low."""
    low = run_of(11, 90, drive={"homing_mm": (0.0, 0.0, -0.12)})
    return solve(low, ("backlash", "link-length", "homing-offset"), tmp_path_factory.mktemp("homed"))


def test_a_slider_that_stands_with_the_others_again_is_told_by_its_side_and_by_the_tool(homed: SimpleNamespace) -> None:
    """Homing counts slider against slider: the value of one goes beyond zero when its error is gone."""
    found = look(homed, run_of(12, 90))
    (change,) = (item for item in found.changed if item.moved.effect == "homing-offset")
    assert change.moved.before < -0.06 and change.moved.now > 0.03 and not found.other_machine
    assert "Repaired: " not in change.words and "um higher" in change.words and "as after a repair" in change.words
    assert found.made_um["now"]["homing-offset"] < 0.2 * found.made_um["before"]["homing-offset"]


def test_where_most_is_otherwise_at_once_the_text_asks_for_another_machine(homed: SimpleNamespace) -> None:
    other = {"backlash_mm": (0.0, 0.0, 0.0), "turn_um": (0.0, 0.0, 30.0)}
    found = look(homed, run_of(13, 90, drive=other))
    assert found.verdict == "new" and found.to_dict()["other_machine"]
    assert found.words.startswith("Most of what the model has is otherwise") and "The repair helped" not in found.words


@pytest.mark.parametrize(
    ("changed", "new", "asks"),
    [({"a", "b"}, 1, True), ({"a", "b"}, 0, False), ({"a"}, 2, False), ({"a", "d"}, 1, False)],
)
def test_two_repairs_are_no_other_machine(changed: set[str], new: int, asks: bool) -> None:
    before = {"a": 20.0, "b": 10.0, "c": 9.0, "d": 1.0, "total": 25.0}
    assert looks_like_another(before, changed, new, 5.0) == asks


@pytest.mark.parametrize(
    ("changed", "asks"),
    [
        ({"a": {"1", "2", "3"}, "b": {"4", "5"}}, True),
        ({"a": {"1", "2", "3"}, "b": {"4"}}, False),  # half of what b had
        ({"a": {"1", "2", "3"}}, False),
        ({"a": {"1"}, "b": {"4", "5"}}, False),
    ],
)
def test_where_most_values_of_all_effects_changed_a_model_of_two_effects_asks_too(changed, asks) -> None:
    clear = {"a": {"1", "2", "3"}, "b": {"4", "5"}}
    assert values_say_another({"a", "b"}, changed, clear) == asks
    assert not values_say_another({"a"}, changed, clear)


def test_a_run_of_another_machine_is_asked_about_with_a_model_of_two_effects(solved: SimpleNamespace) -> None:
    other = {"drive": {"backlash_mm": (0.0, 0.08, 0.0)}, "geometry": {"link_mm": (-0.06, 0.09, 0.12)}}
    found = look(solved, run_of(21, 90, **other))
    assert found.verdict == "changed" and found.other_machine
    assert found.words.startswith("Most of what the model has is otherwise")
    assert any(item.repaired for item in found.changed) and "epaired" not in found.words and "repair" not in found.words


def test_a_repair_of_all_that_a_model_has_is_no_other_machine(solved: SimpleNamespace) -> None:
    sound = {"drive": {"backlash_mm": (0.0, 0.0, 0.0)}, "geometry": {"link_mm": (0.0, 0.0, 0.0)}}
    found = look(solved, run_of(22, 90, **sound))
    assert not found.other_machine and "The repair helped" in found.words


def test_a_value_that_was_not_measured_does_not_change_with_its_effect(solved: SimpleNamespace) -> None:
    """The third link was as drawn: a share of all links says nothing of it."""
    found = look(solved, run_of(23, 90, geometry={"link_mm": (0.0, 0.0, 0.0)}))
    (third,) = (one for one in found.parameters if one.name == "length_mm 3")
    assert "length_mm 3" not in [item.moved.name for item in found.changed]
    assert third.std > 1e-3 and abs(third.z) < 4.0


def test_what_the_model_does_not_have_is_new_and_diagnosed_and_a_change_beside_it_is_named(
    solved: SimpleNamespace,
) -> None:
    found = look(solved, run_of(5, 90, drive={"backlash_mm": (0.03, 0.09, 0.045), "turn_um": (0.0, 0.0, 25.0)}))
    assert found.verdict == "new" and found.to_dict()["suggested"] == [["once-per-rev"]]
    assert [(item.moved.effect, item.moved.joint) for item in found.changed] == [("backlash", 2)]
    kinds = [value.kind for value in values_of(found)]
    assert kinds == sorted(kinds, key=("named", "new", "not named").index) and kinds.count("named") == 1
    (wave,) = found.new.candidates[:1]
    assert max(abs(v.z) for v in values_of(found) if v.kind == "new") == pytest.approx(
        max(abs(one.value / one.std) for one in wave.parameters if one.std)
    )
    bars = {label.replace("\n", " "): um for label, (um, _) in bars_of(found).items()}
    assert bars["with new"] == found.new.rms_um["after"]["total"] < bars["with changes"] < bars["old model"]


@pytest.mark.parametrize(("left", "objects"), [(4.0, False), (6.0, True)])
def test_no_more_than_a_machine_that_has_not_changed_would_show_is_nothing_new(solved, monkeypatch, left, objects):
    """Errors that poses have to themselves may be of values that the old run left uncertain there."""
    problem = run_of(2, 60)
    model, _ = for_runs(solved.model, problem)
    found = find_explanation(build_prior(model, problem), problem, library(), str)
    found = replace(found, state=replace(found.state, memory=replace(found.state.memory, pose=0.3)))
    found = replace(found, prior=replace(found.prior, left=0.0))
    assert problem.noise is not None
    half = replace(problem.noise, covariance=problem.noise.covariance / 4.0)
    monkeypatch.setattr("ptt.again.news.errors_of", lambda found, problem: {"left": left, "expected": 5.0})
    diagnosed = SimpleNamespace(verdict="unknown")
    monkeypatch.setattr("ptt.again.news.diagnose", lambda *asked, **seed: diagnosed)
    assert not found.new
    news = look_for_news(found, model, problem.with_noise(half), library(), str)
    assert news.diagnosis is (diagnosed if objects else None)


def test_what_scatters_far_beyond_a_stated_noise_is_not_expected_of_an_unchanged_machine(solved, tmp_path) -> None:
    """The readings of a third of the poses stand in reverse order: no noise and no wander of a tracker is 37 mm."""
    table = run_of(5, 90).table
    other = ((row := np.arange(table.rows)) >= 40) & (row < 70)
    write_table(
        table.replace(measured=np.where(other[:, None], table.measured[::-1], table.measured)), tmp_path / "r.csv"
    )
    model = ptt.load(solved.folder / "solved.toml")
    found = ptt.recheck(model, ptt.read(tmp_path / "r.csv", model))
    errors = found.result.error_um
    assert errors["expected"] < 0.01 * errors["now"] and found.verdict == "new"
    # what the check of the set-up cannot explain is said as by `ptt diagnose`, and nothing is to be added
    assert found.result.new.unexplained == found.opened.check.unexplained != ""
    assert "30 of 90 readings, between rows 42 and 71, are off the targets" in found.words and "next:" not in str(found)


def test_warmth_is_new_physics_and_no_changed_drawing(solved: SimpleNamespace) -> None:
    warm = {"frame_um_per_m_k": 24.0, "link_um_per_m_k": 2.0}
    room = {"cycles": 3, "pause_s": 1800.0, "room": {"start_c": 20.0, "rise_k": 12.0, "time_constant_s": 3000.0}}
    found = look(solved, run_of(7, 30, thermal=warm, conditions=room))
    assert found.verdict == "new" and not found.changed
    assert found.to_dict()["suggested"][0][0] == "frame-growth"
    assert "named changes" not in str(found)  # none is


def test_what_belongs_to_the_set_up_of_the_first_run_is_not_carried(solved: SimpleNamespace) -> None:
    problem = run_of(2)
    effect = library()["setup-jump"]()
    knocked = replace(
        solved.model, terms=(*solved.model.terms, Term(effect, torch.ones(7, dtype=torch.float64), runs=("a" * 64,)))
    )
    model, _ = for_runs(knocked, problem)
    found = recheck(model, problem)
    assert found.verdict == "same"
    assert any("setup-jump" in note and "not carried" in note for note in found.notes)


def test_a_knock_of_the_tracker_that_is_taken_off_counts_in_no_error(solved: SimpleNamespace) -> None:
    found = look(solved, run_of(2, tracker={"knock_row": 40, "knock_um": (300.0, 0.0, 0.0)}))
    assert found.verdict == "same" and any("setup-jump" in note and "subtracted" in note for note in found.notes)
    assert found.error_um["left"] <= found.error_um["now"] < 1.2 * found.error_um["expected"]
    assert len(bars_of(found)) == 2 and {value.kind for value in values_of(found)} == {"not named"}


def test_a_model_without_a_covariance_takes_each_value_as_uncertain_as_it_says(solved: SimpleNamespace) -> None:
    bare = replace(solved.model, file=replace(solved.model.file, covariance=None))
    problem = run_of(3, drive={"backlash_mm": (0.03, 0.045, 0.045)})
    found = recheck(bare, problem)
    assert [item.moved.name for item in found.changed] == ["gap_mm 2"]
    assert any("covariance" in note for note in found.notes)


def test_a_bare_drawing_is_refused_with_the_way_out(solved: SimpleNamespace) -> None:
    problem = run_of(2, 40)
    with pytest.raises(ModelError, match="no fitted effects") as refused:
        recheck(Model(problem.file), problem)
    assert "ptt diagnose" in refused.value.fix and refused.value.exit_code == 2


def test_the_command_prints_the_documented_keys(
    solved: SimpleNamespace, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    run = tmp_path / "again.csv"
    write_table(run_of(3, drive={"backlash_mm": (0.03, 0.045, 0.045)}).table, run)

    def call(*args: str) -> int:
        return commands.guard(lambda: commands.app(["recheck", str(run), *args], standalone_mode=False))

    assert call("--model", str(solved.folder / "solved.toml"), "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["verdict"] == "changed" and told["since"] == DATE
    assert {"expected", "now"} <= set(told["error_um"])
    (change,) = told["changed"]
    assert {"effect", "parameter", "unit", "before", "now", "std", "z"} <= set(change)
    assert change["z"] > 5 and change["unit"] == "mm"
    assert call("--model", str(solved.folder / "drawing.toml"), "--json") == 2
    out = capsys.readouterr()
    assert out.out == "" and "no fitted effects" in out.err


def test_the_front_door_says_what_the_command_says(solved: SimpleNamespace, tmp_path: Path) -> None:
    run = tmp_path / "again.csv"
    write_table(run_of(2, 60).table, run)
    model = ptt.load(solved.folder / "solved.toml")
    found = ptt.recheck(model, ptt.read(run, model))
    assert found.verdict == "same" and found.to_dict()["verdict"] == "same" and str(found).startswith("verdict: same")
    assert len(found.to_frame()) == 6 and len(found.plot().axes) == 2


def test_the_next_command_names_the_files_as_they_were_given(solved: SimpleNamespace, tmp_path: Path) -> None:
    write_table(run_of(5, 60, drive={"turn_um": (0.0, 0.0, 40.0)}).table, tmp_path / "my run.csv")
    model = ptt.load(solved.folder / "solved.toml")
    found = ptt.recheck(model, ptt.read(tmp_path / "my run.csv", model, set={"payload_kg": 0}))
    assert found.result.suggested == (("once-per-rev",),)
    command = f"ptt add '{tmp_path}/my run.csv' once-per-rev --model {model.path} --set payload_kg=0.0 --out M2.toml"
    assert str(found).splitlines()[-1] == f"next: {command}"
    framed = ptt.recheck(model, found.opened.run.to_frame())
    assert "next: ptt add RUN.csv once-per-rev --model" in str(framed)


def test_a_load_beyond_what_the_model_has_seen_is_said(solved: SimpleNamespace) -> None:
    """A model remembers between which loads it was measured; where a new run leaves them is told."""
    heavy = run_of(9, conditions={"payload_kg": 3.0})
    file = parse_machine((solved.folder / "solved.toml").read_text())
    assert file.history[-1]["ranges"]["payload_kg"] == [0.0, 0.0]
    notes = recheck(read_model(file), heavy).notes
    assert any("payload goes beyond the model's run (3 kg; then 0 to 0)" in note for note in notes), notes
