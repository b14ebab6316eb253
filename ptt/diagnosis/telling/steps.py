"""Steps: the named effects in the order that held-out readings call for, what each is worth, what would do as well."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ptt.diagnosis.evidence.atoms import Atom, holds_sizes, is_drawn, is_metrology, is_sudden
from ptt.diagnosis.evidence.held_out import cross_validate, held_out_rms, lowers_held_out_error, residual_square
from ptt.diagnosis.evidence.held_out_trial import HeldOutTrial
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.evidence.system import holds_unknown
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.laws import is_broad
from ptt.diagnosis.search.moves import added, droppable
from ptt.diagnosis.search.plainest import PLAIN_NATS
from ptt.diagnosis.telling.doubt import tool_doubt

BESIDE_NATS = 25.0  # nats that an effect has to be worth beside a block, whose form is itself only approximate
ODDS_BESIDE = 9.0  # odds to one that `BESIDE_NATS` make against an unknown in the effect's place, for the same reason
# Share of what held-out readings show that an effect alone has to explain: what a block leaves over is less
LEADING_SHARE = 2.0 / 3.0
UNFAITHFUL_SHARE = 0.5  # the same of a name where the whole set does not predict held-out readings
TIE_NATS = 7.0  # nats within which an effect does as well in another's place: a thousand to one, were the forms exact
SCREEN_SLACK = 4.0  # nats by which the screen may misjudge the exact score of a tie
LEAST_STAGES = 3  # events of one kind from which they may be stages of one gradual change
MOST_TIES, MOST_LOOKED_AT = 4, 6  # ties that are named, and candidates that are scored for them
MOST_UNKNOWN = 2  # unknowns scored in an effect's place: those that the screen puts first


@dataclass(frozen=True)
class Step:
    """One named effect.

    Attributes:
        key: of its atom.
        nats: that the explanation loses without it.
        others: names of effects that would do as well in its place.
        share: of the residual's variance after the frame that it takes by itself.
        before: root mean square error on held-out blocks with the steps before it, mm.
        after: with it.
        sure: probability beside an unknown that it is the effect rather than a part of the unknown; else 1.
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
    """What a set of atoms names.

    Attributes:
        steps: the one after which held-out readings are predicted best first.
        unproven: effects that the readings clearly call for though held-out ones do not bear them out, so that they
            cannot be what is there.
        faithful: whether the whole set predicts held-out readings as well as it claims to.
        doubt: how far the machine may have the tool elsewhere while the readings stay, mm; beside an unknown, effects
            of the machine are named only if with that the error on held-out blocks is less than without them.
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
        What it names; of a set that does not predict what it claims to only what is most of the truth by itself.
    """
    atoms, every = scorer.system.atoms, droppable(scorer, state)
    odd = holds_unknown(scorer.system, state.keys, state.memory)
    worth = {key: state.total - _less(scorer, state, key).total for key in every if atoms[key].effect}
    clear = [key for key, nats in worth.items() if nats > (BESIDE_NATS if odd else 0.0)]
    ahead = _ahead_of_unknowns(scorer, state, clear)
    likely = [key for key in clear if not odd or ahead[key] > TIE_NATS]
    if odd:
        leading = [key for key in worth if key not in likely and worth[key] > 0.0 and _leads(scorer, key)]
        ahead |= _ahead_of_unknowns(scorer, state, [key for key in leading if key not in ahead])
        likely += [key for key in leading if ahead[key] > 0.0]
    speaking, faithful = _borne_out(scorer, every, likely)
    named = _delivered(scorer, speaking, 0.0 if faithful else UNFAITHFUL_SHARE)
    if len(named) < len(speaking):  # they may want for one that is somewhat likelier than any unknown
        doubtful = [key for key in clear if key not in likely and ahead[key] > 0.0]
        more = _delivered(scorer, [*speaking, *doubtful], 0.0 if faithful else UNFAITHFUL_SHARE)
        named = more if set(speaking) <= set(more) else named
    if odd:
        named = _without_stages(scorer, every, named)
    order, others = _in_order(scorer, named), {key: ties(scorer, state, key) for key in named}
    doubt = tool_doubt(scorer, state)  # what is tied is scored by now
    if odd:
        order = _harmless(scorer, order, doubt)
    sure = {key: float(1.0 / (1.0 + ODDS_BESIDE ** (-ahead[key] / BESIDE_NATS))) if odd else 1.0 for key in order}
    unproven = tuple(key for key in clear if key not in named and worth[key] > BESIDE_NATS)
    return Named(_steps(scorer, order, worth, others, sure), unproven, faithful, doubt)


def _ahead_of_unknowns(scorer: Scorer, state: State, keys: Sequence[str]) -> dict[str, float]:
    """Nats by which a state is ahead of itself with the best unknown in the place of each of some effects."""
    return {key: state.total - _with_unknown(scorer, state, key) for key in keys}


def _borne_out(scorer: Scorer, every: Sequence[str], likely: Sequence[str]) -> tuple[list[str], bool]:
    """The likely effects that hidden readings speak for, and whether the whole set predicts these."""
    beside = {key: _beside(scorer, every, key) for key in likely}
    trials = {key: cross_validate(scorer, beside[key], key) for key in likely}
    whole = [key for key in likely if len(beside[key]) == len(every)]  # nothing stands aside
    faithful = all(trials[key].faithful for key in whole or likely)
    atoms = scorer.system.atoms
    speaking = [
        key for key in likely if trials[key].supports(PLAIN_NATS) or (faithful and _is_silent(atoms[key], trials[key]))
    ]
    return speaking, faithful


def _harmless(scorer: Scorer, order: list[str], doubt: float) -> list[str]:
    """Of steps beside an unknown those whose commands do no harm: all, those of the tracker alone, or none."""
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
    """The steps with what each does to the error on hidden blocks."""
    steps, before = list[Step](), held_out_rms(scorer, ())
    for index, key in enumerate(order):
        after = held_out_rms(scorer, tuple(order[: index + 1]))
        steps.append(Step(key, worth[key], others[key], share_of(scorer, key), before, after, sure[key]))
        before = after
    return tuple(steps)


def _leads(scorer: Scorer, key: str) -> bool:
    """Whether an effect alone predicts most of what held-out readings show.

    Blocks that bend to anything can do the work of such a one within a few nats, once it is out. No form of theirs that
    is only approximate leaves as much over.
    """
    return cross_validate(scorer, (key,), key).supports(share=LEADING_SHARE)


def _with_unknown(scorer: Scorer, state: State, key: str) -> float:
    """Score of an explanation with the best unknown in an effect's place.

    Whatever is missing, some effect takes a part of it: a name says more only where the unknown would not do as well.
    Laws of one variable are no rivals: on one path some law runs with any effect, and effects are laws that physics
    knows. Nor is a play that varies one of a play: it says the same and more. A curve has to say more than the mean of
    an unknown that varies one.
    """
    less, effect = _less(scorer, state, key), scorer.system.atoms[key].effect
    reverses = effect is not None and effect.reverses

    def is_rival(atom: Atom) -> bool:
        return is_broad(atom) and not (reverses and atom.block is not None and atom.block.reverses)

    unknown = [added(scorer, less, gain).total for gain in scorer.screen(less, is_rival)[:MOST_UNKNOWN]]
    if holds_sizes(scorer.system.atoms[key]):
        unknown += _with_means(scorer, state, less)
    return max(unknown, default=-np.inf)


def _with_means(scorer: Scorer, state: State, less: State) -> list[float]:
    """Scores of a set less a curve with the mean of an unknown of it that varies one with something else.

    Over the run such an unknown has a mean, which is no further unknown.
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


def _delivered(scorer: Scorer, named: list[str], share: float) -> list[str]:
    """Of effects that do well beside blocks those that do well without them, for only effects are sent to a machine.

    Blocks may be needed to make good for what an effect does that is not there.
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
    """Whether an effect is a size of the drawing of which held-out rows tell nothing: few poses show but all together.

    Nothing contradicts it then, and that a size is off asks for no more proof than what is read.
    """
    return is_drawn(atom) and trial.is_silent


def _without_stages(scorer: Scorer, every: Sequence[str], named: list[str]) -> list[str]:
    """The same without what happened so often beside an unknown that it may as well be stages of what went on and on.

    Where not each of them is borne out, those that are say no more than that something changed.
    """
    atoms, stages = scorer.system.atoms, set[str]()
    for kind in {type(atoms[key].effect) for key in named if is_sudden(atoms[key])}:
        alike = {key for key in every if type(atoms[key].effect) is kind}
        stages |= alike if len(alike) >= LEAST_STAGES and not alike <= set(named) else set()
    return [key for key in named if key not in stages]


def _beside(scorer: Scorer, keys: Sequence[str], key: str) -> list[str]:
    """The atoms beside which an effect is judged: a curve whose straight part it is does its work, and stands aside."""
    return [other for other in keys if key == other or not _lends(scorer, other, key)]


def _lends(scorer: Scorer, curve: str, key: str) -> bool:
    """Whether the straight part of a curve is what another effect is."""
    one, two = scorer.system.atoms[curve].effect, scorer.system.atoms[key].effect
    return one is not None and two is not None and any(two.name in each.lent for each in one.parameters)


def share_of(scorer: Scorer, key: str) -> float:
    """Share of what the model as given leaves that one atom takes by itself."""
    nothing, alone = scorer.score((), WHITE), scorer.score((key,), WHITE)
    return float(max(0.0, 1.0 - residual_square(scorer, alone) / max(residual_square(scorer, nothing), 1e-300)))


def _less(scorer: Scorer, state: State, key: str) -> State:
    return scorer.score(without(state, key), state.memory, state.variances)


def _in_order(scorer: Scorer, keys: list[str]) -> list[str]:
    """Each step is the one that predicts held-out readings best, so that their error falls as far as it can.

    What explains most of those that are read may do so by values that are far off until others stand beside it; what
    would need values that cannot be waits until they do.
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


def ties(scorer: Scorer, state: State, key: str) -> tuple[str, ...]:
    """Other effects that would do as well in the place of one.

    Args:
        scorer: of the system.
        state: the best set.
        key: of an effect in it.

    Returns:
        Their names, best first.
    """
    atoms, less = scorer.system.atoms, _less(scorer, state, key)
    own = atoms[key].name

    def other(atom: Atom) -> bool:
        return atom.effect is not None and atom.effect.name != own.partition("[")[0]

    # The screen holds the others' variances, so what it says of the effect itself is what to compare with. What the
    # data cannot tell apart is a tie whatever was likelier before them, so the odds are left aside.
    mine = scorer.screen(less, lambda atom: atom.name == own)
    usual = max((gain.nats + atoms[gain.key].odds for gain in mine), default=-np.inf)
    here = state.total + atoms[key].odds
    found: dict[str, float] = {}
    for gain in sorted(scorer.screen(less, other), key=lambda gain: -gain.nats - atoms[gain.key].odds)[:MOST_LOOKED_AT]:
        odds = atoms[gain.key].odds
        if gain.nats + odds < usual - TIE_NATS - SCREEN_SLACK:
            break
        total = added(scorer, less, gain).total
        if total + odds > here - TIE_NATS:
            found[atoms[gain.key].name] = total
    return tuple(sorted(found, key=lambda name: -found[name])[:MOST_TIES])
