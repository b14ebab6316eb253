"""What a search may say: the moment to the row, the fewest parts, gross errors by the bulk, names that foretell."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from ptt.challenge.cases import draw, plan
from ptt.challenge.challenge import bench as bench_machine
from ptt.challenge.hide import hide_faults
from ptt.challenge.remeasure import remeasure
from ptt.challenge.truth import table_of
from ptt.diagnosis.evidence import score
from ptt.diagnosis.evidence.candidates import first_of
from ptt.diagnosis.evidence.hidden import HiddenTrial
from ptt.diagnosis.evidence.product import nats_of_none, nats_of_product
from ptt.diagnosis.evidence.screen import Gain
from ptt.diagnosis.noise.gross import alone, stand_out
from ptt.diagnosis.noise.memory import WHITE, Memory
from ptt.diagnosis.search import exact, first, follow
from ptt.diagnosis.search import find as finding
from ptt.diagnosis.search import search as searching
from ptt.diagnosis.search.find import find
from ptt.diagnosis.search.improve import ROUNDS, SCREENS, climb, improve
from ptt.diagnosis.search.plainest import PLAIN, plainest
from ptt.diagnosis.search.search import best_of
from ptt.diagnosis.telling import steps
from ptt.diagnosis.telling.verdict import diagnose
from ptt.effects import library
from ptt.fitting.gauss_newton import HOPELESS
from ptt.fitting.moment import place_own_moments
from ptt.fitting.solve import fit
from ptt.machine import load_machine
from ptt.model.chain import predict
from ptt.model.model import Model, Term
from ptt.rig.draw import DrawnRig, draw_rig
from ptt.rig.simulate import simulate
from ptt.run.noise import Noise
from ptt.run.problem import Problem, build_problem
from ptt.run.reading import read_table
from ptt.run.table import make_table

MACHINE = bench_machine()


def hidden(fault: str, seed: int, rows: int = 200) -> tuple[DrawnRig, Problem]:
    drawn = hide_faults(draw_rig("none", seed, MACHINE, "volume", rows=rows), [fault], seed)
    return drawn, build_problem(MACHINE, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))


@pytest.mark.parametrize("off", [-3, -1, 1])
def test_a_slip_is_dated_to_its_row(off):
    drawn, problem = hidden("homing-slip", 31, rows=120)
    effect, time = library()["homing-slip"](), problem.view.time
    last = drawn.rig.drive.slip_row - 1
    term = Term(effect, torch.cat([torch.zeros(3, dtype=torch.float64), time[last + off].reshape(1)]))
    dated = place_own_moments(fit(Model(MACHINE) + term, problem, robust=False), problem)
    assert float(dated.terms[0].theta[-1]) == float(time[last])


def test_of_a_knock_and_a_slip_each_keeps_its_own_moment():
    """Three sliders that slip look like a knock but for turns, so each may be found first where the other was."""
    drawn, truth = draw(plan("multi", 1, 800014, noise=None, bench=None, rows=None, visible=True)[0])
    assert {"homing-slip", "setup-jump"} <= set(drawn.truth)
    problem = build_problem(drawn.rig.machine, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    found = diagnose(Model(drawn.rig.machine), problem)
    terms = {term.effect.name: term for term in found.model.terms}
    assert set(terms) == set(truth.hidden)
    assert float(terms["setup-jump"].theta[-1]) < float(terms["homing-slip"].theta[-1])  # as hidden
    slip, true = terms["homing-slip"], torch.tensor(drawn.truth["homing-slip"]["slip_mm"])
    assert slip.std is not None and (abs(slip.theta[:3] - true) < 4.0 * slip.std[:3]).all()


@dataclass
class Scored:
    """As much of a scorer as the choice among its sets asks for."""

    blocks: frozenset[str]
    scored: dict[object, SimpleNamespace] = field(default_factory=dict)
    given: tuple[str, ...] = ()
    drawn: frozenset[str] = frozenset()

    @property
    def system(self) -> SimpleNamespace:
        atoms = {
            key: SimpleNamespace(
                block=SimpleNamespace(on=("x",)) if key in self.blocks else None,
                effect=None if key in self.blocks else SimpleNamespace(stands_for=(), of_drawing=key in self.drawn),
                columns=range(30 if key == "b" else 3),
                tested=key != "p",
                shape=None if key in "abcpu" else {},
            )
            for key in "abcpun"
        }
        clock = SimpleNamespace(is_fault=lambda wander: False)
        return SimpleNamespace(atoms=atoms, clock=clock, errs_by_pose=lambda memory: memory.pose > 0.0)

    def add(self, keys: str, total: float, memory: Memory = WHITE) -> SimpleNamespace:
        state = SimpleNamespace(keys=tuple(keys), memory=memory, total=total, forms={})
        self.scored[keys, memory] = state
        return state

    def score(self, keys: Sequence[str], memory: Memory) -> SimpleNamespace:
        return self.scored["".join(keys), memory]


def test_of_sets_that_do_alike_the_one_with_the_fewest_parts_is_said():
    scorer = Scored(frozenset("u"))
    best = scorer.add("abc", 100.0)
    scorer.add("ab", 100.0 - PLAIN - 0.1)
    assert plainest(scorer, best) is best  # what a third name brings is worth saying
    fewer = scorer.add("ac", 100.0 - PLAIN + 0.1)
    assert plainest(scorer, best) is fewer
    plain = scorer.add("ac", 96.0)
    scorer.add("bc", 99.0)
    assert plainest(scorer, best) is plain  # a curve of thirty values bends to anything
    scorer.add("ap", 100.0)
    assert plainest(scorer, best) is plain  # play that no reversal shows
    scorer.add("au", 100.0)
    assert plainest(scorer, best) is plain  # a name before an unknown
    scorer.add("a", 99.0, Memory(pose=1.0))
    assert plainest(scorer, best) is plain  # errors of each pose to itself are an unknown, too
    scorer.add("an", 96.9)
    assert plainest(scorer, best) is plain  # what the model has comes before what does as well
    other = scorer.add("an", 97.1)
    assert plainest(scorer, best) is other


def test_more_than_two_sizes_of_a_drawing_are_hardly_more_than_two():
    for drawn, said in ((frozenset("acnp"), "acn"), (frozenset("a"), "ab")):
        scorer = Scored(frozenset("u"), drawn=drawn)
        best = scorer.add("acn", 100.0)
        curve = scorer.add("ab", 99.0)  # of thirty values, as much as two and a half names beside the other
        assert plainest(scorer, best) is (best if said == "acn" else curve)


def test_a_curve_is_as_much_as_an_unknown_so_the_likelier_of_both_is_said():
    scorer = Scored(frozenset("u"))
    curve, unknown = scorer.add("ab", 100.0), scorer.add("au", 99.0)
    assert plainest(scorer, curve) is curve
    unknown = scorer.add("au", 101.0)
    assert plainest(scorer, unknown) is unknown  # of few rows either could be anything
    plain = scorer.add("an", 97.0)
    assert plainest(scorer, unknown) is plain


def test_gross_errors_do_not_hide_in_a_noise_that_they_have_widened():
    random = np.random.default_rng(5)
    left = random.normal(size=(200, 3))
    left[[20, 90, 160]] += 15.0
    widened = left / 5.0
    rows = np.ones(200, dtype=bool)
    assert not stand_out(widened, rows).any()
    assert np.flatnonzero(stand_out(widened, rows, least=0.0)).tolist() == [20, 90, 160]


def test_what_does_not_foretell_hidden_readings_is_no_name(monkeypatch):
    _, problem = hidden("tower-position", 33, rows=100)
    named = diagnose(Model(MACHINE), problem)
    assert named.verdict == "missing" and named.suggested[0][0] == "tower-position"
    monkeypatch.setattr(steps, "hold_back", lambda *_: gaining(-9.0))  # as if more were worse
    doubted = diagnose(Model(MACHINE), problem)
    assert doubted.verdict == "unknown" and not doubted.suggested
    assert doubted.depends_on  # what it follows is said all the same


class Sums:
    """A scorer of sets whose totals are written down; 'u' and 'v' are unknowns, 'e' and 'f' effects."""

    given: tuple[str, ...] = ()

    def __init__(self, totals: dict[str, float]) -> None:
        self.totals = totals
        atoms = {key: SimpleNamespace(key=key, block=None, effect=None, odds=14.0) for key in "uvef"}
        for key in "uv":
            atoms[key].block = SimpleNamespace(on=("x",), reverses=False, is_curve=False, varies_curve=False)
        for key in "ef":
            atoms[key].effect = SimpleNamespace(
                parameters=(), name=key, stage="drive", reverses=False, of_drawing=False
            )
        self.system = SimpleNamespace(atoms=atoms, rows=range(50), errs_by_pose=lambda memory: memory.pose > 0.0)

    def score(self, keys, memory, scales=None, least=None):
        named = tuple(sorted(keys))
        return SimpleNamespace(keys=named, total=self.totals["".join(named)], memory=memory, scales={}, forms={})

    def screen(self, state, allowed):
        gain = SimpleNamespace(key="v", scales=None)
        return [gain] if allowed(self.system.atoms["v"]) and "v" not in state.keys else []


def gaining(more):
    """A trial in which each of ten blocks is worse by so much without an atom."""
    return HiddenTrial(np.full(10, 3.0), np.full(10, 3.0 + more), 100.0, np.zeros(1), 30, np.full(10, more))


@pytest.mark.parametrize(
    ("instead", "more", "sure"),
    [
        (97.0, 5.0, None),
        (80.0, 5.0, 0.853),
        (40.0, 9.0, 0.995),
        (40.0, 0.5, None),
        (97.0, 9.0, 0.566),
        (103.0, 9.0, None),
    ],
)
def test_a_name_beside_an_unknown_says_more_than_another_unknown_in_its_place(monkeypatch, instead, more, sure):
    """And it foretells hidden readings by more than chance lets it do; one that takes most may be near."""
    scorer = Sums({"eu": 100.0, "u": 30.0, "uv": instead})
    monkeypatch.setattr(steps, "held_out", lambda scorer, keys: 9.0 - 2.0 * ("e" in keys) - ("u" in keys))
    monkeypatch.setattr(steps, "hold_back", lambda *_: gaining(more))
    monkeypatch.setattr(steps, "tool_doubt", lambda *_: 0.0)
    for name, answer in (("share_of", 0.5), ("ties", ()), ("_in_order", ["e"] if sure else [])):
        monkeypatch.setattr(steps, name, lambda *_, answer=answer: answer)
    told = steps.name_steps(scorer, scorer.score("eu", WHITE))
    assert [step.key for step in told.steps] == ([] if sure is None else ["e"])
    assert bool(told.unproven) is not bool(told.steps)
    assert sure is None or told.steps[0].sure == pytest.approx(sure, abs=1e-3)
    monkeypatch.setattr(steps, "tool_doubt", lambda *_: 6.0)  # beside the 7 of hidden rows more than 9 without it
    assert not steps.name_steps(scorer, scorer.score("eu", WHITE)).steps


@pytest.mark.parametrize(
    ("place", "varies", "there", "named"),
    [
        ("slider 2", True, False, []),
        ("slider 2", False, False, ["e"]),
        ("rail 2", True, False, ["e"]),
        ("slider 2", True, True, ["e"]),
    ],
)
def test_a_curve_says_more_than_the_mean_of_an_unknown_that_varies_one(monkeypatch, place, varies, there, named):
    """Of 85 nats with the mean at the same place instead of it, which is no further unknown: 99."""
    scorer = Sums({"eu": 100.0, "e": 90.0, "u": 30.0, "uv": 85.0})
    atoms = scorer.system.atoms
    atoms["e"].effect.parameters = (SimpleNamespace(lent=("lead-scale",)),)
    for key, on, curve, where in (("u", "time", False, "slider 2"), ("v", "b2", True, place)):
        atoms[key].block = SimpleNamespace(
            on=(on,), reverses=False, is_curve=curve, varies_curve=varies and not curve,
            place=SimpleNamespace(residual=where),
        )  # fmt: skip
    scorer.opens = lambda keys: lambda atom: not there
    monkeypatch.setattr(steps, "held_out", lambda scorer, keys: 9.0 - 2.0 * ("e" in keys) - ("u" in keys))
    monkeypatch.setattr(steps, "hold_back", lambda *_: gaining(9.0))
    for name, answer in (("tool_doubt", 0.0), ("share_of", 0.5), ("ties", ()), ("_leads", False)):
        monkeypatch.setattr(steps, name, lambda *_, answer=answer: answer)
    assert [step.key for step in steps.name_steps(scorer, scorer.score("eu", WHITE)).steps] == named


@pytest.mark.parametrize(("worth", "pose", "named"), [(18.0, 0.0, True), (18.0, 1.0, False), (60.0, 1.0, True)])
def test_what_comes_back_with_its_pose_is_an_unknown_beside_which_a_name_takes_more(monkeypatch, worth, pose, named):
    scorer = Sums({"e": 100.0, "": 100.0 - worth, "v": 100.0 - worth})
    monkeypatch.setattr(steps, "held_out", lambda scorer, keys: 9.0 - 2.0 * ("e" in keys))
    monkeypatch.setattr(steps, "hold_back", lambda scorer, keys, key: gaining(9.0 if len(keys) else 0.0))
    monkeypatch.setattr(steps, "_leads", lambda *_: False)
    for name, answer in (("tool_doubt", 0.0), ("share_of", 0.5), ("ties", ())):
        monkeypatch.setattr(steps, name, lambda *_, answer=answer: answer)
    told = steps.name_steps(scorer, scorer.score("e", replace(WHITE, pose=pose)))
    assert [step.key for step in told.steps] == (["e"] if named else [])


@pytest.mark.parametrize(("beside", "named"), [(8.0, ["e"]), (9.5, [])])
def test_beside_an_unknown_what_the_tracker_does_is_named_if_hidden_readings_gain_by_it(monkeypatch, beside, named):
    scorer = Sums({"eu": 100.0, "e": 90.0, "u": 30.0, "uv": 40.0})
    scorer.system.atoms["e"].effect.stage = "metrology"
    monkeypatch.setattr(steps, "held_out", lambda scorer, keys: beside if "e" in keys else 9.0)
    monkeypatch.setattr(steps, "hold_back", lambda *_: gaining(9.0))
    for name, answer in (("tool_doubt", 20.0), ("share_of", 0.5), ("ties", ())):
        monkeypatch.setattr(steps, name, lambda *_, answer=answer: answer)
    assert [step.key for step in steps.name_steps(scorer, scorer.score("eu", WHITE)).steps] == named


def test_the_first_step_is_the_one_that_foretells_hidden_readings_best_whatever_takes_most(monkeypatch):
    """A curve may take most of the readings by values that are far off until others stand beside it."""
    errors = {"": 150.0, "e": 600.0, "f": 60.0, "g": 90.0, "ef": 20.0, "fg": 30.0, "eg": 300.0, "efg": 6.0}
    monkeypatch.setattr(steps, "held_out", lambda scorer, keys: errors["".join(sorted(keys))])
    totals = dict.fromkeys(errors, 50.0)
    assert steps._in_order(Sums(totals), ["e", "f", "g"]) == ["f", "e", "g"]
    alone = Sums(totals | {"f": -np.inf})  # it would need values that cannot be
    assert steps._in_order(alone, ["e", "f", "g"]) == ["g", "f", "e"]


def test_only_effects_are_sent_to_a_machine_so_without_unknowns_they_must_do_well(monkeypatch):
    errors = {"": 61.0, "e": 62.0, "f": 20.0, "ef": 25.0}  # beside unknowns both may look needed
    monkeypatch.setattr(steps, "held_out", lambda scorer, keys: errors["".join(sorted(keys))])
    without = {"ef": {"e": 20.0, "f": 62.0}, "f": {"f": 61.0}}
    monkeypatch.setattr(
        steps, "hold_back", lambda scorer, keys, key: gaining(without["".join(keys)][key] - errors["".join(keys)])
    )
    assert steps._delivered(Sums({}), ["e", "f"], 0.0) == ["f"]


def test_a_wrong_unit_of_length_in_a_trusted_frame_is_the_tracker_s():
    """It stretches about where the tracker stands and so shifts as well; towers moved for it make a tool worse."""
    trusted = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"frame": "trusted"}))
    drawn = draw_rig("none", 42, trusted, "volume", rows=80)
    tracker = {"scale_ppm": -70.0, "translation_mm": (0.0, 0.0, 0.0), "rotation_mrad": (0.0, 0.0, 0.0)}
    drawn = replace(drawn, rig=replace(drawn.rig, tracker=drawn.rig.tracker.model_copy(update=tracker)))
    problem = build_problem(trusted, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    found = diagnose(Model(trusted), problem)
    assert found.verdict == "missing" and found.suggested == (("tracker-scale",),)
    scale, *shift = [parameter.value for parameter in found.candidates[0].parameters]
    station = np.array(drawn.rig.tracker.station_mm)
    np.testing.assert_allclose(-np.array(shift) / scale, station, atol=0.25 * np.linalg.norm(station))


@pytest.mark.parametrize("scale", [5e-5, -2e-4])
def test_a_unit_that_stretches_about_the_origin_is_the_tracker_s_too(scale):
    """Software that scales readings in the frame of the base; a lead shared by all sliders looks much the same."""
    trusted = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"frame": "trusted", "base_point": ()}))
    random = np.random.default_rng(5)
    target = random.uniform(-60.0, 60.0, (300, 3))
    measured = target * (1.0 + scale) + random.normal(0.0, 0.003, target.shape)
    found = diagnose(Model(trusted), build_problem(trusted, make_table(target, measured=measured)))
    assert found.verdict == "missing" and len(found.suggested) == 1
    assert found.suggested[0][0] == "tracker-scale" and set(found.suggested[0][1:]) <= {"lead-scale"}


def test_readings_that_are_shifted_without_a_wrong_unit_are_not_surely_one():
    """A unit that is right has no place about which it could stretch so far that all is shifted by this much."""
    trusted = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"frame": "trusted"}))
    drawn = draw_rig("none", 42, trusted, "volume", rows=80)
    tracker = {"translation_mm": (0.08, -0.05, 0.03), "rotation_mrad": (0.0, 0.0, 0.0)}
    drawn = replace(drawn, rig=replace(drawn.rig, tracker=drawn.rig.tracker.model_copy(update=tracker)))
    problem = build_problem(trusted, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    found = diagnose(Model(trusted), problem)
    assert found.verdict == "missing" and "tracker-frame" in found.suggested[0]


def test_a_product_s_prior_is_that_of_its_place():
    """Against sums over many draws of the first value; where readings say nothing of the others it is nothing."""
    random, read, error, width = np.random.default_rng(0), np.array([1.0, 2.0, -0.5, 0.3]), 0.1, 2.0
    first = random.normal(0.0, np.sqrt(width), 400_000)
    given, linear = np.square(first)[:, None] + error**2, width + error**2
    own = -0.5 * np.square(read[0] - first) / 0.09
    logs = own - 0.5 * (np.square(read[1:]) / given + np.log(given)).sum(axis=1)
    plain = own - 0.5 * (np.square(read[1:]) / linear + np.log(linear)).sum()
    information = np.diag([1.0 / 0.09, *[error**-2] * 3])
    covariance = np.linalg.inv(information + np.eye(4) / width)
    expected = np.log(np.exp(logs).mean()) - np.log(np.exp(plain).mean())
    assert nats_of_product(covariance @ information @ read, covariance, width) == pytest.approx(expected, abs=0.05)
    unseen = np.diag([0.01, width, width, width])
    assert nats_of_product(np.array([1.0, 0.0, 0.0, 0.0]), unseen, width) == pytest.approx(0.0, abs=1e-9)
    none = (
        -0.5 * (np.square(read[1:] / error) + np.log(error**2)).sum()
        + 0.5 * (np.square(read[1:]) / linear + np.log(linear)).sum()
    )
    assert nats_of_none(covariance @ information @ read, covariance, width) == pytest.approx(none, abs=1e-6)
    assert nats_of_none(np.array([1.0, 0.0, 0.0, 0.0]), unseen, width) == pytest.approx(0.0, abs=1e-9)


def test_against_a_frame_that_the_file_trusts_stands_all_that_looks_like_it_in_the_machine():
    """On a circle towers and zeros do what towers and a shifted tracker do: sent without the zeros, they do harm."""
    drawn, _ = draw(plan("unknown", 1, 1000009, kinds="all")[0])
    assert drawn.rig.machine.tracker.frame == "trusted"
    problem = build_problem(drawn.rig.machine, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    found = diagnose(Model(drawn.rig.machine), problem)
    assert "tracker-frame" in {name for step in found.suggested for name in step[1:]}
    tool = remeasure(found.model, drawn).to_dict()
    assert tool["after"]["total"] < 0.1 * tool["before"]["total"]


def _unloaded(places: np.ndarray) -> np.ndarray:
    """Places at one load and one feed, as `places_of` has them."""
    return np.column_stack([places, np.zeros((len(places), 2))])


@pytest.mark.parametrize("often", [2, 5])
def test_a_pose_that_most_visits_miss_alike_has_no_gross_errors(often):
    """Rows 10 and 30 miss one pose alike: at all of two visits it is the pose, at two of five it is chance."""
    random = np.random.default_rng(3)
    left, places = random.normal(size=(60, 3)), _unloaded(100.0 * random.normal(size=(60, 9)))
    left[[10, 30]] += (0.0, 25.0, 0.0)
    left[[11, 21, 31]] += 25.0 * np.eye(3)
    places[[10, 30, 40, 45, 50][:often]] = places[10]
    rows = np.ones(60, dtype=bool)
    lone = alone(stand_out(left, rows), left, rows, places)
    assert lone[[11, 21]].all() and bool(lone[[10, 30]].all()) is (often > 2)


@pytest.mark.parametrize(("others", "gone", "gross"), [(0, 0, False), (60, 0, True), (0, 60, True)])
def test_two_visits_that_miss_alike_are_chance_where_so_many_beams_were_broken(others, gone, gross):
    """Of 400 poses that were visited twice one pair of broken beams agrees; alone it is the pose."""
    random = np.random.default_rng(4)
    pose = _unloaded(100.0 * random.normal(size=(400, 9)))
    left, places = random.normal(size=(800, 3)), np.tile(pose, (2, 1))
    wide = 2 + np.arange(others) * 6
    left[wide] += 30.0 * random.normal(size=(others, 3))
    left[[1, 401]] = (0.0, 25.0, 0.0)
    rows = np.ones(800, dtype=bool)
    lone = alone(stand_out(left, rows), left, rows, places, gone)
    assert bool(lone[[1, 401]].all()) is gross and lone[[1, 401]].any() == gross


def test_a_second_knock_without_a_first_is_the_first():
    assert first_of("setup-jump[second]", {"setup-jump[second]", "backlash"}) == "setup-jump"
    assert first_of("setup-jump[second]", {"setup-jump[second]", "setup-jump"}) == "setup-jump[second]"
    assert first_of("once-per-rev[harmonic 2]", {"once-per-rev[harmonic 2]"}) == "once-per-rev[harmonic 2]"


@pytest.mark.parametrize(
    ("fault", "seed", "leads"),
    [("cross-coupling", 35, ("b1", "b2", "b3")), pytest.param("loose-joint", 36, ("x", "y"), marks=pytest.mark.long)],
)
def test_an_unknown_needs_no_names_beside_it_and_leads_with_its_variable(fault, seed, leads):
    drawn, problem = hidden(fault, seed)
    found = diagnose(Model(MACHINE), problem)
    truth = drawn.truth[fault]
    assert found.verdict == "unknown" and not found.suggested
    assert found.depends_on[0].residual == f"slider {truth['leg']}"
    assert (
        found.depends_on[0].on == f"b{truth['other']}" if fault == "cross-coupling" else found.depends_on[0].on in leads
    )


class Endless:
    """As much of a scorer as a search asks for, where every swap makes a set a little better and none is the last."""

    def __init__(self) -> None:
        atoms = [
            SimpleNamespace(key=f"a{i}", name=f"a{i}", columns=range(3), effect=None, block=None, odds=9.0)
            for i in range(60)
        ]
        self.system = SimpleNamespace(atoms={atom.key: atom for atom in atoms})
        self.given, self.screens, self.scored = (), 0, 0

    @property
    def looked_at(self) -> int:
        return self.screens

    def score(self, keys: Sequence[str], memory: Memory, scales: object = None, least: float = 0.0) -> SimpleNamespace:
        self.scored += 1
        total = -100.0 * abs(len(keys) - 8) + 0.4 * self.scored
        return SimpleNamespace(
            keys=tuple(sorted(keys)), memory=memory, total=total, scales={}, forms={}, worth=lambda key: 99.0
        )

    def screen(self, state: SimpleNamespace, allowed: object) -> list[Gain]:
        self.screens += 1
        return [Gain(50.0, key, np.ones(1)) for key in self.system.atoms if key not in state.keys]

    def replacements(self, state: SimpleNamespace, keys: Sequence[str], *of: object) -> dict[str, set[str]]:
        return {key: set(self.system.atoms) - set(state.keys) for key in keys}

    def best_memory(self, state: SimpleNamespace) -> tuple[Memory, float]:
        return state.memory, 0.0


class Crowded:
    """As much of a scorer as a search asks for: what comes in the place of 'a' loses 5 nats, and makes room for 'c'."""

    given, looked_at = (), 0

    def __init__(self, after: float) -> None:
        named = {key: SimpleNamespace(key=key, name=key, columns=range(3), effect=None, block=None) for key in "abc"}
        for atom in named.values():
            atom.odds = 3.0
        self.system = SimpleNamespace(atoms=named)
        self.totals = {"a": 0.0, "b": -5.0, "ac": -9.0, "bc": -5.0 + after, "c": -90.0, "": -99.0}

    def score(self, keys: Sequence[str], memory: Memory, scales: object = None, least: float = 0.0) -> SimpleNamespace:
        total = self.totals.get("".join(sorted(keys)), -90.0)
        return SimpleNamespace(
            keys=tuple(sorted(keys)), memory=memory, total=total, scales={}, forms={}, worth=lambda key: 99.0
        )

    def screen(self, state: SimpleNamespace, allowed: Callable[[SimpleNamespace], bool]) -> list[Gain]:
        return [Gain(50.0, key, np.ones(1)) for key in self.system.atoms if key not in state.keys]

    def replacements(self, state: SimpleNamespace, keys: Sequence[str], *of: object) -> dict[str, set[str]]:
        return {key: {"b"} for key in keys}

    def best_memory(self, state: SimpleNamespace) -> tuple[Memory, float]:
        return state.memory, 0.0


def test_what_a_swap_makes_room_for_is_looked_for_beyond_it():
    for after, keys in ((18.0, ("b", "c")), (3.0, ("a",))):
        scorer = Crowded(after)
        start = scorer.score(("a",), WHITE)
        assert improve(scorer, start).keys == keys
        assert improve(scorer, start, swaps=False).keys == ("a",)


def test_a_climb_looks_for_no_swaps(monkeypatch):
    scorer, swapped = Endless(), list[float]()
    looked_for = scorer.replacements
    monkeypatch.setattr(
        scorer, "replacements", lambda state, *of: swapped.append(state.total) or looked_for(state, *of)
    )
    assert climb(scorer, scorer.score([f"a{i}" for i in range(8)], WHITE)).total > 0.0 and not swapped
    improve(scorer, scorer.score([f"a{i}" for i in range(8)], WHITE))
    assert swapped


def test_swaps_are_looked_for_from_every_end(monkeypatch):
    scorer, begun = Endless(), list[tuple[str, ...]]()
    ends = [scorer.score(keys, WHITE) for keys in (["a1", "a2"], ["a3"], ["a2", "a1"])]
    monkeypatch.setattr(searching, "improve", lambda scorer, state, *of, **more: begun.append(state.keys) or state)
    assert best_of(scorer, ends).total == max(end.total for end in ends)
    assert begun == [ends[0].keys, ends[1].keys]


def test_moments_are_dated_before_any_swap_is_looked_for(monkeypatch):
    """Beside a jump at the wrong row swaps would look for what makes good for it."""
    _, problem = hidden("homing-slip", 31, rows=120)
    dated = list[bool]()

    def told(scorer, ends):
        dated.append(any("#after" in key for key in scorer.system.atoms))
        return best_of(scorer, ends)

    monkeypatch.setattr(first, "best_of", told)
    for place in (first, finding, follow):  # so that it is searched from nothing
        monkeypatch.setattr(place, "names_suffice", lambda *of: False)
    found = find(Model(MACHINE), problem, library(), lambda what: None)
    assert dated and all(dated[:1]) and {found.system.atoms[key].name for key in found.state.keys} == {"homing-slip"}


def test_a_search_without_end_gives_the_best_so_far_after_so_many_screens():
    scorer, rounds = Endless(), 0
    state = scorer.score([f"a{i}" for i in range(8)], WHITE)
    while scorer.looked_at < SCREENS:  # as a search starts anew from one end and another
        state, rounds = improve(scorer, state), rounds + 1
    assert rounds < SCREENS / 10
    before, looked_at = state.total, scorer.looked_at
    again = improve(scorer, state)
    assert again.total >= before and scorer.looked_at <= looked_at + ROUNDS < SCREENS + 10 * ROUNDS


@pytest.mark.parametrize(
    ("windup", "backlash", "dropped"),
    [
        (("converged", 1.0), (HOPELESS, 0.0), {"windup"}),
        ((HOPELESS, 1.0), (HOPELESS, 0.0), set()),
        (("converged", 2.0), ("converged", 1.0), {"backlash"}),
        (("converged", 1.0), ("converged", 2.0), {"windup"}),
    ],
)
def test_only_a_fit_that_came_to_its_end_says_that_an_effect_is_needless(monkeypatch, windup, backlash, dropped):
    """On its way down a fit may stand lower than where sizes that it has yet to learn let it stay.

    Of two without either of which as much is told as with both, the one goes without which more is.
    """
    drawn = hide_faults(draw_rig("none", 41, MACHINE, "volume", rows=60), ["backlash", "windup"], 41)
    problem = build_problem(MACHINE, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    both = Model(MACHINE) + library()["backlash"]() + library()["windup"]()
    fitted = fit(both, problem, robust=False)
    less = {
        key: replace(fitted, model=fitted.model.without(key), status=status, chi2=fitted.chi2 + more)
        for key, (status, more) in {"windup": windup, "backlash": backlash}.items()
    }
    monkeypatch.setattr(exact, "fit_less", lambda model, *_: less[(set(both.keys) - set(model.keys)).pop()])
    assert set(exact.without_needless(as_found(fitted), problem).keys) == set(both.keys) - dropped


def as_found(fitted, **more):
    """As much of an explanation by the effects of a fit as is asked for what is needless in it."""
    keys = fitted.model.keys
    state = SimpleNamespace(keys=keys, worth=lambda key: key == "backlash", posterior=SimpleNamespace(phi=1.0))
    system = SimpleNamespace(atoms={key: SimpleNamespace(odds=3.0) for key in keys})
    scorer = SimpleNamespace(given=(), system=system)
    return SimpleNamespace(
        fitted=fitted,
        scorer=scorer,
        state=state,
        system=system,
        **{"carried": None, "gross": None, "noise": None, **more},
    )


def wound_over(length: float) -> Problem:
    """Readings of a machine that winds up over a short travel, along a spiral in and out, up and down."""
    turn, time = np.linspace(0.0, 33.3, 130), np.linspace(0.0, 1.0, 130)
    radius = 40.0 * np.abs(1.0 - 2.0 * time)
    place = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), 20.0 * np.sin(14.45 * time)])
    file = replace(MACHINE, tracker=MACHINE.tracker.model_copy(update={"sigma_mm": 0.003}))
    table = make_table(place, measured=place)
    windup = library()["windup"](), torch.tensor([0.1, 0.11, 0.05, *[length] * 3], dtype=torch.float64)
    reading = predict([windup], build_problem(file, table).view).reading.numpy()
    noisy = reading + np.random.default_rng(6).normal(0.0, 0.003, reading.shape)
    return build_problem(file, replace(table, measured=noisy))


def test_windup_over_a_short_travel_is_no_play():
    problem = wound_over(0.05)
    found = diagnose(Model(problem.file), problem)
    assert found.verdict == "missing" and found.suggested == (("windup",),)
    assert float(found.model.terms[0].theta[-1]) == pytest.approx(0.05, rel=0.1)


def test_without_play_a_windup_is_looked_for_as_if_nothing_were_known():
    """Beside play it had what that left, over a length from which its fit leads to none at all."""
    problem = wound_over(0.3)
    beside = torch.tensor([0.01, 0.005, 0.01, *[0.001] * 3], dtype=torch.float64)
    play = torch.tensor([0.08, 0.09, 0.06, 1.0], dtype=torch.float64)
    both = Model(problem.file) + Term(library()["backlash"](), play) + Term(library()["windup"](), beside)
    noise = Noise(9e-6 * np.eye(3), "machine file")
    fitted = fit(both, problem, noise=noise, robust=False, coarse=True)
    none = {"carried": np.zeros((130, 3)), "gross": np.zeros(130, dtype=bool), "noise": noise}
    less = exact.without_needless(as_found(fitted, **none), problem)
    assert less.keys == ("windup",) and float(less.terms[0].theta[-1]) == pytest.approx(0.3, rel=0.1)


def test_what_is_forgotten_of_sets_of_long_ago_is_worked_out_again(monkeypatch):
    drawn = hide_faults(draw_rig("none", 41, MACHINE, "volume", rows=60), ["link-length", "backlash"], 41)
    problem = build_problem(MACHINE, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    kept = diagnose(Model(MACHINE), problem)
    scored = list[tuple]()
    work_out = score.Scorer._score
    monkeypatch.setattr(score.Scorer, "_score", lambda self, *what: scored.append(what[:2]) or work_out(self, *what))
    monkeypatch.setattr(score, "ROOM", 1)  # number: of one set alone the factor is kept
    found = diagnose(Model(MACHINE), problem)
    assert len(scored) > 1.2 * len(set(scored))
    assert {name for (name,) in found.suggested} == {name for (name,) in kept.suggested} == {"link-length", "backlash"}
    assert found.verdict_probability == pytest.approx(kept.verdict_probability, abs=0.01)


def test_a_set_that_was_only_told_to_be_far_is_scored_when_it_is_asked_for():
    drawn = hide_faults(draw_rig("none", 41, MACHINE, "volume", rows=60), ["link-length", "backlash"], 41)
    problem = build_problem(MACHINE, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    system, far = find(Model(MACHINE), problem, library(), lambda what: None).system, 0
    for key in list(system.atoms)[:60]:
        whole, hasty = score.Scorer(system), score.Scorer(system)
        exact = whole.score([key], WHITE, {})
        told = hasty.score([key], WHITE, {}, exact.total + 100.0)
        far += told.posterior.ended
        assert told.total <= exact.total + 0.1
        assert hasty.score([key], WHITE).total == pytest.approx(exact.total, abs=0.1)
        assert not hasty.score([key], WHITE).posterior.ended
    assert far > 5


def test_what_is_needless_is_asked_beside_the_unknowns_of_now():
    """A run in which a wind-up and an unknown take turns: the play alone says it all, once neither is carried along."""
    folder = Path(__file__).parent.parent / "data" / "sealed_one"
    machine = load_machine(folder / "machine.toml")
    found = diagnose(Model(machine), build_problem(machine, read_table(folder / "run.csv")))
    assert found.suggested == (("backlash",),) and not found.outliers.any()


def test_from_a_set_that_cannot_be_anything_may_be_the_way_out():
    """Without its unknown a clearance is below zero: no screen of such a set says what may come in its place."""
    drawn, truth = draw(plan("multi", 1, 1090007, kinds="all", noise=None, bench=None, rows=None, visible=True)[0])
    frame = simulate(drawn.rig, drawn.targets).frame
    found = diagnose(Model(drawn.rig.machine), build_problem(drawn.rig.machine, table_of(frame, drawn.absent)))
    assert {step[0] for step in found.suggested} == set(truth.hidden)
    assert found.verdict == "missing"
