"""A search that swaps, climbs, dates and ends."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from test_diagnosis_search import as_found, hidden

from ptt.challenge.challenge import bench as bench_machine
from ptt.challenge.hide import hide_faults
from ptt.challenge.truth import table_of
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.screen import Gain
from ptt.diagnosis.noise.memory import WHITE, Memory
from ptt.diagnosis.search import exact, first, follow, moves
from ptt.diagnosis.search import find as finding
from ptt.diagnosis.search import search as searching
from ptt.diagnosis.search.find import find
from ptt.diagnosis.search.improve import MOST_MOVES, MOST_SCREENS, climb, improve
from ptt.diagnosis.search.search import best_of
from ptt.effects import library
from ptt.fitting.gauss_newton import HOPELESS
from ptt.fitting.solve import fit
from ptt.model.model import Model
from ptt.rig.draw import draw_rig
from ptt.rig.simulate import simulate
from ptt.run.problem import build_problem

MACHINE = bench_machine()


@pytest.fixture(autouse=True)
def swaps_of_stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    """What stands for a scorer below says itself what may replace what."""
    real = moves.replacements
    monkeypatch.setattr(
        moves, "replacements", lambda scorer, *of: getattr(scorer, "replacements", partial(real, scorer))(*of)
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
    def screened_count(self) -> int:
        return self.screens

    less = Scorer.less

    def score(
        self, keys: Sequence[str], memory: Memory, variances: object = None, least: float = 0.0
    ) -> SimpleNamespace:
        self.scored += 1
        total = -100.0 * abs(len(keys) - 8) + 0.4 * self.scored
        return SimpleNamespace(
            keys=tuple(sorted(keys)), memory=memory, total=total, variances={}, forms={}, worth=lambda key: 99.0
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

    given, screened_count = (), 0

    def __init__(self, after: float) -> None:
        named = {key: SimpleNamespace(key=key, name=key, columns=range(3), effect=None, block=None) for key in "abc"}
        for atom in named.values():
            atom.odds = 3.0
        self.system = SimpleNamespace(atoms=named)
        self.totals = {"a": 0.0, "b": -5.0, "ac": -9.0, "bc": -5.0 + after, "c": -90.0, "": -99.0}

    less = Scorer.less

    def score(
        self, keys: Sequence[str], memory: Memory, variances: object = None, least: float = 0.0
    ) -> SimpleNamespace:
        total = self.totals.get("".join(sorted(keys)), -90.0)
        return SimpleNamespace(
            keys=tuple(sorted(keys)), memory=memory, total=total, variances={}, forms={}, worth=lambda key: 99.0
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
    while scorer.screened_count < MOST_SCREENS:  # as a search starts anew from one end and another
        state, rounds = improve(scorer, state), rounds + 1
    assert rounds < MOST_SCREENS / 10
    before, looked_at = state.total, scorer.screened_count
    again = improve(scorer, state)
    assert again.total >= before and scorer.screened_count <= looked_at + MOST_MOVES < MOST_SCREENS + 10 * MOST_MOVES


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
    drawn = hide_faults(draw_rig(41, MACHINE, "volume", rows=60), ["backlash", "windup"], 41)
    problem = build_problem(MACHINE, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    both = Model(MACHINE) + library()["backlash"]() + library()["windup"]()
    fitted = fit(both, problem, robust=False)
    less = {
        key: replace(fitted, model=fitted.model.without(key), status=status, chi2=fitted.chi2 + more)
        for key, (status, more) in {"windup": windup, "backlash": backlash}.items()
    }
    monkeypatch.setattr(exact, "fit_less", lambda model, *_: less[(set(both.keys) - set(model.keys)).pop()])
    assert set(exact.without_needless(as_found(fitted), problem).keys) == set(both.keys) - dropped
