"""What predicts hidden readings is a name, in which order, and beside which unknowns."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_diagnosis_search import hidden

from ptt.challenge.challenge import bench as bench_machine
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence.held_out_trial import HeldOutTrial
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.telling import steps
from ptt.model.model import Model

MACHINE = bench_machine()


def test_what_does_not_predict_hidden_readings_is_no_name(monkeypatch):
    _, problem = hidden("tower-position", 33, rows=100)
    named = diagnose(Model(MACHINE), problem)
    assert named.verdict == "missing" and named.suggested[0][0] == "tower-position"
    monkeypatch.setattr(steps, "cross_validate", lambda *_: gaining(-9.0))  # as if more were worse
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
            atoms[key].block = SimpleNamespace(
                on=("x",), reverses=False, is_law=False, is_curve=False, varies_curve=False
            )
        for key in "ef":
            atoms[key].effect = SimpleNamespace(
                parameters=(), name=key, stage="drive", reverses=False, of_drawing=False
            )
        self.system = SimpleNamespace(atoms=atoms, rows=range(50), errs_by_pose=lambda memory: memory.pose > 0.0)

    less = Scorer.less

    def score(self, keys, memory, variances=None, least=None):
        named = tuple(sorted(keys))
        return SimpleNamespace(keys=named, total=self.totals["".join(named)], memory=memory, variances={}, forms={})

    def screen(self, state, allowed):
        gain = SimpleNamespace(key="v", variances=None)
        return [gain] if allowed(self.system.atoms["v"]) and "v" not in state.keys else []


def gaining(more):
    """A trial in which each of ten blocks is worse by so much without an atom."""
    return HeldOutTrial(np.full(10, 3.0), np.full(10, 3.0 + more), 100.0, np.zeros(1), 30, np.full(10, more))


def predict(monkeypatch, error):
    """Hidden readings are missed by what `error` says of a set, in each of ten blocks alike."""
    monkeypatch.setattr(steps, "held_out_rms", lambda scorer, keys: error(keys))
    each = np.ones(10)
    monkeypatch.setattr(
        "ptt.diagnosis.evidence.held_out.held_out_squares", lambda scorer, keys: (error(keys) ** 2 * each, each)
    )


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
    """And it predicts hidden readings by more than chance lets it do; one that takes most may be near."""
    scorer = Sums({"eu": 100.0, "u": 30.0, "uv": instead})
    predict(monkeypatch, lambda keys: 9.0 - 2.0 * ("e" in keys) - ("u" in keys))
    monkeypatch.setattr(steps, "cross_validate", lambda *_: gaining(more))
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
            on=(on,), reverses=False, is_law=False, is_curve=curve, varies_curve=varies and not curve,
            place=SimpleNamespace(residual=where, part=where),
        )  # fmt: skip
    scorer.opens = lambda keys: lambda atom: not there
    predict(monkeypatch, lambda keys: 9.0 - 2.0 * ("e" in keys) - ("u" in keys))
    monkeypatch.setattr(steps, "cross_validate", lambda *_: gaining(9.0))
    for name, answer in (("tool_doubt", 0.0), ("share_of", 0.5), ("ties", ()), ("_leads", False)):
        monkeypatch.setattr(steps, name, lambda *_, answer=answer: answer)
    assert [step.key for step in steps.name_steps(scorer, scorer.score("eu", WHITE)).steps] == named


@pytest.mark.parametrize(("worth", "pose", "named"), [(18.0, 0.0, True), (18.0, 1.0, False), (60.0, 1.0, True)])
def test_what_comes_back_with_its_pose_is_an_unknown_beside_which_a_name_takes_more(monkeypatch, worth, pose, named):
    scorer = Sums({"e": 100.0, "": 100.0 - worth, "v": 100.0 - worth})
    predict(monkeypatch, lambda keys: 9.0 - 2.0 * ("e" in keys))
    monkeypatch.setattr(steps, "cross_validate", lambda scorer, keys, key: gaining(9.0 if len(keys) else 0.0))
    monkeypatch.setattr(steps, "_leads", lambda *_: False)
    for name, answer in (("tool_doubt", 0.0), ("share_of", 0.5), ("ties", ())):
        monkeypatch.setattr(steps, name, lambda *_, answer=answer: answer)
    told = steps.name_steps(scorer, scorer.score("e", replace(WHITE, pose=pose)))
    assert [step.key for step in told.steps] == (["e"] if named else [])


@pytest.mark.parametrize(("beside", "named"), [(8.0, ["e"]), (9.5, [])])
def test_beside_an_unknown_what_the_tracker_does_is_named_if_hidden_readings_gain_by_it(monkeypatch, beside, named):
    scorer = Sums({"eu": 100.0, "e": 90.0, "u": 30.0, "uv": 40.0})
    scorer.system.atoms["e"].effect.stage = "metrology"
    predict(monkeypatch, lambda keys: beside if "e" in keys else 9.0)
    monkeypatch.setattr(steps, "cross_validate", lambda *_: gaining(9.0))
    for name, answer in (("tool_doubt", 20.0), ("share_of", 0.5), ("ties", ())):
        monkeypatch.setattr(steps, name, lambda *_, answer=answer: answer)
    assert [step.key for step in steps.name_steps(scorer, scorer.score("eu", WHITE)).steps] == named


def test_the_first_step_is_the_one_that_predicts_hidden_readings_best_whatever_takes_most(monkeypatch):
    """A curve may take most of the readings by values that are far off until others stand beside it."""
    errors = {"": 150.0, "e": 600.0, "f": 60.0, "g": 90.0, "ef": 20.0, "fg": 30.0, "eg": 300.0, "efg": 6.0}
    monkeypatch.setattr(steps, "held_out_rms", lambda scorer, keys: errors["".join(sorted(keys))])
    totals = dict.fromkeys(errors, 50.0)
    assert steps._in_order(Sums(totals), ["e", "f", "g"]) == ["f", "e", "g"]
    alone = Sums(totals | {"f": -np.inf})  # it would need values that cannot be
    assert steps._in_order(alone, ["e", "f", "g"]) == ["g", "f", "e"]


def test_only_effects_are_sent_to_a_machine_so_without_unknowns_they_must_do_well(monkeypatch):
    errors = {"": 61.0, "e": 62.0, "f": 20.0, "ef": 25.0}  # beside unknowns both may look needed
    monkeypatch.setattr(steps, "held_out_rms", lambda scorer, keys: errors["".join(sorted(keys))])
    without = {"ef": {"e": 20.0, "f": 62.0}, "f": {"f": 61.0}}
    monkeypatch.setattr(
        steps, "cross_validate", lambda scorer, keys, key: gaining(without["".join(keys)][key] - errors["".join(keys)])
    )
    assert steps._without_blocks(Sums({}), ["e", "f"], 0.0) == ["f"]
