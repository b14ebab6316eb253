"""Moves from one set of atoms to others: what is scored exactly, and what is not for it could not be better."""

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest

from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.screen import Gain
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.moves import plain_moves


@dataclass
class Noted:
    """A scorer that notes which sets it is asked for; atoms are worth what is written down."""

    screened: dict[str, float]
    exact: dict[str, float]
    worth: dict[str, float] = field(default_factory=dict)
    given: tuple[str, ...] = ()
    asked: list[str] = field(default_factory=list)
    less = Scorer.less

    @property
    def system(self) -> SimpleNamespace:
        atom = SimpleNamespace(effect=SimpleNamespace(), block=None, odds=10.0)
        return SimpleNamespace(atoms=dict.fromkeys([*self.screened, *self.worth], atom))

    def start(self, total: float = 0.0) -> SimpleNamespace:
        return SimpleNamespace(
            keys=tuple(self.worth), memory=WHITE, total=total, variances={}, worth=lambda key: self.worth[key]
        )

    def screen(self, state: object, allowed: object) -> list[Gain]:
        gains = sorted(self.screened.items(), key=lambda item: -item[1])
        return [Gain(nats, key, np.ones(1)) for key, nats in gains]

    def score(self, keys: tuple[str, ...], *others: object) -> SimpleNamespace:
        new, gone = set(keys) - set(self.worth), set(self.worth) - set(keys)
        changed = "".join(sorted(new)) or "-" + "".join(sorted(gone))
        self.asked.append(changed)
        return SimpleNamespace(keys=keys, total=self.exact.get(changed, 0.0))


@pytest.mark.parametrize(
    ("second", "asked"),
    [(900.0, ["a", "b"]), (700.0, ["a", "b"]), (500.0, ["a"])],
)
def test_what_the_screen_has_far_behind_what_is_scored_is_not_scored(second: float, asked: list[str]) -> None:
    scorer = Noted({"a": 1000.0, "b": second}, {"a": 1020.0, "b": 1.3 * second})
    plain_moves(scorer, scorer.start(), lambda atom: True)
    assert scorer.asked == asked


def test_after_a_leader_that_cannot_be_the_others_are_scored() -> None:
    scorer = Noted({"a": 1000.0, "b": 100.0}, {"a": -np.inf, "b": 110.0})
    moves = plain_moves(scorer, scorer.start(), lambda atom: True)
    assert scorer.asked == ["a", "b"] and max(move.total for move in moves) == 110.0


def test_an_atom_that_is_worth_far_more_than_its_odds_stays() -> None:
    """One that does nothing brings its odds back; one of 20 nats may hold up others, one of 30 does not."""
    scorer = Noted({}, {"-x": -9.0, "-y": 2.0}, worth={"x": 0.1, "y": 20.0, "z": 30.0})
    moves = plain_moves(scorer, scorer.start(), lambda atom: True)
    assert scorer.asked == ["-x", "-y"] and max(move.total for move in moves) == 2.0


def test_from_a_set_that_cannot_be_anything_may_be_the_way_out() -> None:
    scorer = Noted({"a": 1000.0, "b": 10.0}, {"a": -np.inf, "b": -np.inf}, worth={"x": 90.0})
    plain_moves(scorer, scorer.start(-np.inf), lambda atom: True)
    assert scorer.asked == ["a", "b", "-x"]
