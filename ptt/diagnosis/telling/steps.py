"""Steps: the named effects in the order in which held-out readings are predicted best, with worth and ties."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom, holds_sizes, is_drawn, is_metrology, is_sudden
from ptt.diagnosis.evidence.held_out import (
    cross_validate,
    held_out_rms,
    lowers_held_out_error,
    raises_held_out_error,
    residual_square,
)
from ptt.diagnosis.evidence.held_out_trial import HeldOutTrial
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.system import holds_unknown
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.laws import is_broad
from ptt.diagnosis.search.moves import added, droppable
from ptt.diagnosis.search.plainest import PLAIN_NATS
from ptt.diagnosis.telling.doubt import tool_doubt
from ptt.diagnosis.telling.ties import TIE_NATS, ties

BESIDE_NATS = 25.0  # nats that an effect has to be worth beside a block, whose form is itself only approximate
ODDS_BESIDE = 9.0  # odds to one that `BESIDE_NATS` make against an unknown in the effect's place, for the same reason
# Share of what held-out readings show that an effect alone has to explain: what a block leaves over is less
LEADING_SHARE = 2.0 / 3.0
UNFAITHFUL_SHARE = 0.5  # the same of a name where the whole set does not predict held-out readings
LEAST_STAGES = 3  # events of one kind from which they may be stages of one gradual change
MOST_UNKNOWN = 2  # unknowns scored in an effect's place: those that the screen puts first


@dataclass(frozen=True)
class Step:
    """One named effect.

    Attributes:
        key: of its atom.
        nats: that the explanation loses without it.
        others: names of effects that would do as well in its place.
        share: share of the residual variance after the frame that it explains by itself.
        before: root mean square error on held-out blocks with the steps before it, mm.
        after: the same with it, mm.
        sure: beside an unknown, probability that it is this effect rather than a part of the unknown; else 1.
    """

    key: str
    nats: float
    others: tuple[str, ...]
    share: float
    before: float
    after: float
    sure: float = 1.0


@dataclass(frozen=True)
class Named:
    """The effects that a set names.

    Attributes:
        steps: the named effects; first the one after which held-out readings are predicted best.
        unproven: effects with clear evidence that held-out readings do not confirm, so that they are not what is
            missing.
        faithful: whether the whole set predicts held-out readings as well as it claims.
        doubt: doubt in the tool's position that no reading shows, mm. Beside an unknown, effects of the machine are
            named only if they lower the held-out error by more than that.
    """

    steps: tuple[Step, ...]
    unproven: tuple[str, ...]
    faithful: bool
    doubt: float


def name_steps(scorer: Scorer, state: State) -> Named:
    """The effects that a state names beyond those given.

    Args:
        scorer: of the system.
        state: the best set.

    Returns:
        The named effects; of a set that does not predict held-out readings as well as it claims, only those that
        explain most by themselves.
    """
    atoms, every = scorer.system.atoms, droppable(scorer, state)
    odd = holds_unknown(scorer.system, state.keys, state.memory)
    worth = {key: state.total - scorer.less(state, key).total for key in every if atoms[key].effect}
    clear = [key for key, nats in worth.items() if nats > (BESIDE_NATS if odd else 0.0)]
    ahead = _ahead_of_unknowns(scorer, state, clear)
    likely = [key for key in clear if not odd or ahead[key] > TIE_NATS]
    if odd:
        leading = [key for key in worth if key not in likely and worth[key] > 0.0 and _leads(scorer, key)]
        ahead |= _ahead_of_unknowns(scorer, state, [key for key in leading if key not in ahead])
        likely += [key for key in leading if ahead[key] > 0.0]
    supported, faithful = _supported(scorer, every, likely)
    named = _without_blocks(scorer, supported, 0.0 if faithful else UNFAITHFUL_SHARE)
    if len(named) < len(supported):  # they may need another one that is a little likelier than any unknown
        doubtful = [key for key in clear if key not in likely and ahead[key] > 0.0]
        more = _without_blocks(scorer, [*supported, *doubtful], 0.0 if faithful else UNFAITHFUL_SHARE)
        named = more if set(supported) <= set(more) else named
    if odd:
        named = _without_stages(scorer, every, named)
    order, others = _in_order(scorer, named), {key: ties(scorer, state, key) for key in named}
    doubt = tool_doubt(scorer, state)  # after the ties, which are then among the scored sets
    if odd:
        order = _lowering_error(scorer, order, doubt)
    sure = {key: float(1.0 / (1.0 + ODDS_BESIDE ** (-ahead[key] / BESIDE_NATS))) if odd else 1.0 for key in order}
    unproven = tuple(key for key in clear if key not in named and worth[key] > BESIDE_NATS)
    return Named(_steps(scorer, order, worth, others, sure), unproven, faithful, doubt)


def _ahead_of_unknowns(scorer: Scorer, state: State, keys: Sequence[str]) -> dict[str, float]:
    """Key of an effect -> nats that the set loses with the best unknown in the effect's place."""
    return {key: state.total - _with_unknown(scorer, state, key) for key in keys}


def _supported(scorer: Scorer, every: Sequence[str], likely: Sequence[str]) -> tuple[list[str], bool]:
    """The likely effects that held-out readings support, and whether the whole set predicts these faithfully."""
    beside = {key: _beside(scorer, every, key) for key in likely}
    trials = {key: cross_validate(scorer, beside[key], key) for key in likely}
    whole = [key for key in likely if len(beside[key]) == len(every)]  # nothing stands aside
    faithful = all(trials[key].faithful for key in whole or likely)
    atoms = scorer.system.atoms
    supported = [
        key for key in likely if trials[key].supports(PLAIN_NATS) or (faithful and _is_silent(atoms[key], trials[key]))
    ]
    return supported, faithful


def _lowering_error(scorer: Scorer, order: list[str], doubt: float) -> list[str]:
    """Steps beside an unknown that lower the held-out error: all, those of the tracker alone, or none.

    A step that raises by a factor what those before it leave is none of them: these may lower it for both.
    """
    kept = order[:1]
    for key in order[1:]:
        kept += [] if raises_held_out_error(scorer, (*kept, key)) else [key]
    order = kept
    if lowers_held_out_error(scorer, tuple(order), doubt):
        return order
    order = [key for key in order if is_metrology(scorer.system.atoms[key])]
    return order if lowers_held_out_error(scorer, tuple(order)) else []  # a drift and a knock that undo each other, say


def _steps(
    scorer: Scorer,
    order: Sequence[str],
    worth: Mapping[str, float],
    others: Mapping[str, tuple[str, ...]],
    sure: Mapping[str, float],
) -> tuple[Step, ...]:
    """The steps with the held-out error before and after each."""
    steps, before = list[Step](), held_out_rms(scorer, ())
    for index, key in enumerate(order):
        after = held_out_rms(scorer, tuple(order[: index + 1]))
        steps.append(Step(key, worth[key], others[key], share_of(scorer, key), before, after, sure[key]))
        before = after
    return tuple(steps)


def _leads(scorer: Scorer, key: str) -> bool:
    """Whether an effect alone predicts most of what held-out readings show.

    Flexible blocks can replace such an effect within a few nats; but what an approximate block leaves over for an
    effect that is not there is never as much.
    """
    return cross_validate(scorer, (key,), key).supports(share=LEADING_SHARE)


def _with_unknown(scorer: Scorer, state: State, key: str) -> float:
    """Score of an explanation with the best unknown block in an effect's place.

    Whatever is missing, some effect explains part of it, so a name means something only where an unknown does less
    well. Laws of one variable do not compete: on one path some law is collinear with any effect. Nor do blocks of
    direction of arrival compete with a reversing effect, as they contain it. A curve also has to beat the mean, over
    the run, of an unknown that varies a curve.
    """
    less, effect = scorer.less(state, key), scorer.system.atoms[key].effect
    reverses = effect is not None and effect.reverses

    def is_rival(atom: Atom) -> bool:
        return is_broad(atom) and not (reverses and atom.block is not None and atom.block.reverses)

    unknown = [added(scorer, less, gain).total for gain in scorer.screen(less, is_rival)[:MOST_UNKNOWN]]
    if holds_sizes(scorer.system.atoms[key]):
        unknown += _with_means(scorer, state, less)
    return max(unknown, default=-np.inf)


def _with_means(scorer: Scorer, state: State, less: State) -> list[float]:
    """Scores of a set with a block curve, at no further odds, in the place of a named curve.

    Only where the set has an unknown that varies a curve at the same part: its mean over the run is no further unknown.
    """
    atoms = scorer.system.atoms
    blocks = {key: atom.block for key, atom in atoms.items() if atom.block is not None and is_broad(atom)}
    varied = {blocks[key].place.part for key in state.keys if key in blocks and blocks[key].varies_curve}
    opens = scorer.opens(less.keys)
    means = [key for key, block in blocks.items() if block.is_curve and block.place.part in varied]
    return [
        scorer.score((*less.keys, key), less.memory, less.variances).total + atoms[key].odds
        for key in means
        if opens(atoms[key])
    ]


def _without_blocks(scorer: Scorer, named: list[str], share: float) -> list[str]:
    """Effects that held-out readings support without any blocks beside them, found by backward elimination.

    Only effects correct a machine, and a block may have made up for an effect that is not really there.
    """
    while named:
        trials = {key: cross_validate(scorer, _beside(scorer, named, key), key) for key in named}
        silent = [key for key, trial in trials.items() if not share and _is_silent(scorer.system.atoms[key], trial)]
        vain = [key for key, trial in trials.items() if key not in silent and not trial.supports(share=share)]
        if not vain:
            break
        named = [key for key in named if key != max(vain, key=lambda key: held_out_rms(scorer, (key,)))]
    return named


def _is_silent(atom: Atom, trial: HeldOutTrial) -> bool:
    """Whether an effect is a size of the drawing on which held-out blocks are silent, as with few poses.

    Nothing contradicts it then, and for a size that is off the evidence of the fit suffices.
    """
    return is_drawn(atom) and trial.is_silent


def _without_stages(scorer: Scorer, every: Sequence[str], named: list[str]) -> list[str]:
    """Names without events of a kind that is so frequent that they may be stages of one gradual change.

    Where not every one of them is confirmed, those that are only show that something changed.
    """
    atoms, stages = scorer.system.atoms, set[str]()
    for kind in {type(atoms[key].effect) for key in named if is_sudden(atoms[key])}:
        alike = {key for key in every if type(atoms[key].effect) is kind}
        stages |= alike if len(alike) >= LEAST_STAGES and not alike <= set(named) else set()
    return [key for key in named if key not in stages]


def _beside(scorer: Scorer, keys: Sequence[str], key: str) -> list[str]:
    """The atoms beside which an effect is judged: all but curves whose straight part is the same thing."""
    return [other for other in keys if key == other or not _lends(scorer, other, key)]


def _lends(scorer: Scorer, curve: str, key: str) -> bool:
    """Whether the straight part of a curve is the same as another effect."""
    one, two = scorer.system.atoms[curve].effect, scorer.system.atoms[key].effect
    return one is not None and two is not None and any(two.name in each.lent for each in one.parameters)


def share_of(scorer: Scorer, key: str) -> float:
    """Share of the residual of the model as given that one atom explains by itself."""
    nothing, alone = scorer.score((), WHITE), scorer.score((key,), WHITE)
    return float(max(0.0, 1.0 - residual_square(scorer, alone) / max(residual_square(scorer, nothing), 1e-300)))


def _in_order(scorer: Scorer, keys: list[str]) -> list[str]:
    """Effects in greedy order of the held-out error; those with physically impossible values at a step wait.

    The effect that explains most of the fitted readings may do so with values that are wrong until others are beside
    it.
    """
    order: list[str] = []
    rest = list(keys)

    def after(key: str) -> tuple[bool, float]:
        return not np.isfinite(scorer.score((*order, key), WHITE).total), held_out_rms(scorer, (*order, key))

    while rest:
        best = min(rest, key=after)
        order.append(best)
        rest.remove(best)
    return order
