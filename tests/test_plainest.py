"""Which of the sets that do alike is said: the fewest parts, a name before an unknown."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace

from ptt.diagnosis.noise.memory import WHITE, Memory
from ptt.diagnosis.search.plainest import PLAIN_NATS, plainest


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
    scorer.add("ab", 100.0 - PLAIN_NATS - 0.1)
    assert plainest(scorer, best) is best  # what a third name brings is worth saying
    fewer = scorer.add("ac", 100.0 - PLAIN_NATS + 0.1)
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
