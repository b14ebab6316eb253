"""Instead: what plain effects, sizes of the drawing and the tracker do in the place of what can do their work."""

from collections.abc import Sequence

from ptt.diagnosis.evidence.atoms import Atom, holds_sizes, is_drawn, is_effect, is_field, is_metrology
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.diagnosis.noise.memory import Memory
from ptt.diagnosis.search.improve import improve
from ptt.diagnosis.search.moves import LEAST_NATS, SCREEN_ERROR, SEEN_NATS, TRIED, added, droppable, worth_a_try

PLAIN_COLUMNS = 12  # columns up to which an effect is a plain one rather than a curve: four values a leg


def refilled(scorer: Scorer, best: State) -> State:
    """Ask what names do in the place of unknowns, and plain ones in the place of what can do several's work.

    Args:
        scorer: of the system.
        best: a set to which no plain move adds anything.

    Returns:
        The best set found.
    """
    best = _named_instead(scorer, best)
    if smooth := [key for key in droppable(scorer, best) if _goes_by_place(scorer.system.atoms[key])]:
        drawn = drawn_instead(scorer, best, smooth, best.memory)
        best = improve(scorer, drawn) if drawn.total > best.total + LEAST_NATS else best
    for key in droppable(scorer, best):
        for other in (_instead_of, _beside):
            if key in best.keys and len(scorer.system.atoms[key].columns) > PLAIN_COLUMNS:
                best = other(scorer, best, key)
        if key in best.keys:
            best = _commoner(scorer, best, key)
    return _asked_of_tracker(scorer, best)


def _named_instead(scorer: Scorer, best: State) -> State:
    """A set with names alone in the place of its unknowns, and plain ones beside a curve that then has their part.

    A curve with what is a tower's in it is far too wide; the screen holds it so, and the unknown has both their parts.
    """
    blocks = [key for key in droppable(scorer, best) if scorer.system.atoms[key].block is not None]
    if not blocks:
        return best
    fewer = scorer.score(without(best, *blocks), best.memory, best.variances)
    named = improve(scorer, fewer, is_effect, swaps=False)
    for key in droppable(scorer, named):
        if key in named.keys and len(scorer.system.atoms[key].columns) > PLAIN_COLUMNS:
            named = _beside(scorer, named, key)
    return named if named.total > best.total + LEAST_NATS else best


def drawn_instead(scorer: Scorer, best: State, gone: Sequence[str], memory: Memory) -> State:
    """The best set of names with all sizes of the drawing that are needed in the place of what varies with the place.

    On a machine of which each is off by no more than readings scatter none alone is worth its name, and all that one
    more does on the way to them is less than an unknown does at once.

    Args:
        scorer: of the system.
        best: a set.
        gone: unknowns and curves of it that go.
        memory: of the noise.
    """
    rest = without(best, *gone)
    drawn = {atom.name for atom in scorer.system.atoms.values() if is_drawn(atom)}
    all_of_them = scorer.score((*rest, *_coming(scorer, rest, drawn)), memory, best.variances)
    fewer = improve(scorer, all_of_them, _is_none, swaps=False)
    return improve(scorer, fewer, is_plain, swaps=False)


def _goes_by_place(atom: Atom) -> bool:
    """Whether an atom is an unknown of the place, or a curve of which sizes of the drawing are part."""
    return is_field(atom) or holds_sizes(atom)


def _is_none(atom: Atom) -> bool:
    return False


def _instead_of(scorer: Scorer, best: State, key: str) -> State:
    """A set with as many plain effects as it takes in the place of a curve, which may come back beside them.

    Swaps one for one never find those: none of them alone is worth as much.
    """
    fewer = scorer.score(without(best, key), best.memory, best.variances)
    if not worth_a_try(scorer, fewer, is_plain):
        return best
    plain = improve(scorer, fewer, is_plain, swaps=False)
    if set(plain.keys) <= set(fewer.keys):  # none takes its place: what another curve can do, a swap has tried
        return best
    other = improve(scorer, plain, swaps=False)
    return improve(scorer, other) if other.total > best.total + LEAST_NATS else best


def _beside(scorer: Scorer, best: State, key: str) -> State:
    """A set with plain effects that take from a curve what is theirs; with those alone whose slope and level it has.

    The screen holds the curve as wide as it is. That the rest of it is narrower once its slope has a name, only an
    exact score tells.
    """
    near = [gain for gain in scorer.screen(best, is_plain) if gain.nats > SEEN_NATS - SCREEN_ERROR]
    tried = [added(scorer, best, gain) for gain in near[:TRIED]]
    lenders = _lenders(scorer, best, key)
    if lenders:
        tried.append(scorer.score((*without(best, key), *lenders), best.memory, best.variances))
    other = max(tried, key=lambda state: state.total, default=best)
    return improve(scorer, other) if other.total > best.total + LEAST_NATS else best


def _commoner(scorer: Scorer, best: State, key: str) -> State:
    """A set with the commoner causes that an effect looks like together in its place, as far as they are needed.

    None of them alone is worth as much, and what comes first without the effect may be yet another.
    """
    there = commoner(scorer, best, key)
    if there is None:
        return best
    other = improve(scorer, there, is_plain, swaps=False)
    return improve(scorer, other) if other.total > best.total + LEAST_NATS else best


def commoner(scorer: Scorer, state: State, key: str) -> State | None:
    """A set with all the commoner causes that an effect of it looks like together in its place.

    Args:
        scorer: of the system.
        state: a set.
        key: of the effect's atom.

    Returns:
        The set; None where the effect looks like itself alone, or where one of these may not stand beside the others.
    """
    effect = scorer.system.atoms[key].effect
    if effect is None or not effect.stands_for:
        return None
    rest = without(state, key)
    names = set(effect.stands_for) - {scorer.system.atoms[other].name for other in rest}
    coming = _coming(scorer, rest, names)
    return scorer.score((*rest, *coming), state.memory, state.variances) if 0 < len(names) == len(coming) else None


def _lenders(scorer: Scorer, state: State, key: str) -> list[str]:
    """Atoms of the effects beyond a set whose own cause slope and level of one of its curves are."""
    effect = scorer.system.atoms[key].effect
    names = {name for parameter in effect.parameters for name in parameter.lent} if effect is not None else set()
    return _coming(scorer, without(state, key), names)


def _coming(scorer: Scorer, keys: Sequence[str], names: set[str]) -> list[str]:
    """An atom of each effect of some names that may come beside a set and the others."""
    found = list[str]()
    for name in sorted(names):
        may_come = scorer.opens([*keys, *found])
        found += [key for key, atom in scorer.system.atoms.items() if atom.name == name and may_come(atom)][:1]
    return found


def _asked_of_tracker(scorer: Scorer, best: State) -> State:
    """Take each effect of the machine out in turn for all that the tracker may have done instead, and the other way.

    A machine that is corrected for what the tracker did is worse off than before, and so is one that is not for what
    it did itself. Either may have done two things at once, which no swap one for one finds.
    """
    for key in droppable(scorer, best):
        atom = scorer.system.atoms[key]
        if key in best.keys and atom.effect is not None:
            fewer = scorer.score(without(best, key), best.memory, best.variances)
            other = improve(scorer, fewer, _is_of_machine if is_metrology(atom) else is_metrology, swaps=False)
            if other.total > best.total + LEAST_NATS:
                best = improve(scorer, other)
    return best


def _is_of_machine(atom: Atom) -> bool:
    return is_plain(atom) and not is_metrology(atom)


def is_plain(atom: Atom) -> bool:
    """Whether an atom is an effect of a few values, no curve that bends to anything."""
    return atom.effect is not None and len(atom.columns) <= PLAIN_COLUMNS
