"""Jumps along the travel: what a sudden effect is held against before anybody is told that something happened.

A rail of two pieces, a dent, a loose clamp are passed again and again; told as slips and knocks they would be sent to a
machine as if the last of them had come to stay. A jump in time has a reason only if no place of a joint has it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ptt.diagnosis.atoms import SHAPE_POWER, Atom, atoms_of_blocks, is_block, odds_of_block
from ptt.diagnosis.blocks import Block, Place, places_of_chain
from ptt.diagnosis.row_system import RowSystem
from ptt.diagnosis.score import Scorer, State
from ptt.diagnosis.search import LEAST, improve, loose, plainest, without
from ptt.diagnosis.system import whitened
from ptt.effects.sudden import Sudden

HEIGHTS = 24  # first tried along each joint; then each between two visited ones beside the best
EDGE = 0.05  # share of the rows before and after any jump
HOPEFUL = 40.0  # nats by which the first step of a search may lie behind the sudden effects that it is to replace


def jumps_instead(scorer: Scorer, state: State) -> tuple[Scorer, State]:
    """Take sudden effects out for jumps at a height of a joint, where these say as much.

    Args:
        scorer: of a linearised problem.
        state: the best set.

    Returns:
        A scorer that knows the jumps where any were tried, and the better set, as given where there is none.
    """
    system = scorer.system
    sudden = [key for key in loose(scorer, state) if isinstance(system.atoms[key].effect, Sudden)]
    if not sudden or not isinstance(system, RowSystem):
        return scorer, state
    wider, best = _with_jumps(scorer, _first_heights(system)), state
    for gone in dict.fromkeys([tuple(sudden), *((key,) for key in sudden)]):
        if set(gone) <= set(best.keys):
            wider, best = _instead(wider, best, gone)
    return wider, best


def _instead(scorer: Scorer, state: State, gone: Sequence[str]) -> tuple[Scorer, State]:
    """The best set with what lasts for some sudden effects, jumps along the travel first; or the set as it is."""
    fewer = scorer.score(without(state, *gone), state.memory, state.scales)
    jumped = improve(scorer, fewer, is_jump, swaps=False)
    scorer = _with_jumps(scorer, _finer(scorer, jumped))
    jumped = improve(scorer, _at_best_heights(scorer, jumped), is_jump, swaps=False)
    found = [state]
    for start in dict.fromkeys([jumped.keys, fewer.keys]):
        other = scorer.score(start, state.memory)
        most = max((gain.nats for gain in scorer.screen(other, _lasts)), default=0.0)
        if other.total + max(most, 0.0) > state.total - HOPEFUL:
            found.append(improve(scorer, other, _lasts, swaps=False))
    best = max(found, key=lambda other: other.total)
    return scorer, plainest(scorer, best) if best.total > state.total + LEAST else state


def is_jump(atom: Atom) -> bool:
    """Whether an atom is a jump at a height of a joint."""
    return atom.block is not None and atom.key != atom.name


def _lasts(atom: Atom) -> bool:
    return not isinstance(atom.effect, Sudden)


Heights = Mapping[str, tuple[Place, np.ndarray]]  # name -> where it acts, and heights of its joint, mm


def _first_heights(system: RowSystem) -> Heights:
    """Heights spread over what each joint visited, for what acts on it and for its rail."""
    found = {}
    q = system.at.problem.view.q.numpy()[system.rows]
    for place in places_of_chain(system.at.problem, system.at.chain):
        if place.joint is not None:
            between = _between(q[:, place.joint])
            few = between[np.unique(np.linspace(0, len(between) - 1, HEIGHTS).round().astype(int))]
            found[f"{place.residual} jumps"] = place, few
    return found


def _between(heights: np.ndarray) -> np.ndarray:
    """Middles between neighbouring heights, some rows on either side of each."""
    order = np.sort(heights)
    edge = max(int(EDGE * len(order)), 3)
    inner = np.unique(order[edge - 1 : len(order) - edge + 1])
    return np.asarray(0.5 * (inner[1:] + inner[:-1])) if len(inner) > 1 else inner


def _finer(scorer: Scorer, state: State) -> Heights:
    """Every height between those tried beside the jumps of a set."""
    system = scorer.system
    assert isinstance(system, RowSystem)
    q, found = system.at.problem.view.q.numpy()[system.rows], {}
    for key in state.keys:
        atom = system.atoms[key]
        if is_jump(atom):
            assert atom.block is not None and atom.block.place.joint is not None
            tried = np.sort([_height(other) for other in system.atoms.values() if other.name == atom.name])
            between, at = _between(q[:, atom.block.place.joint]), int(np.searchsorted(tried, _height(atom)))
            low, high = tried[max(at - 1, 0)], tried[min(at + 1, len(tried) - 1)]
            found[atom.name] = atom.block.place, between[(between > low) & (between < high)]
    return found


def _height(atom: Atom) -> float:
    return float(atom.key.partition("#")[2])


def _at_best_heights(scorer: Scorer, state: State) -> State:
    """A set with each of its jumps at the height where it does best."""
    for key in state.keys:
        name = scorer.system.atoms[key].name
        if is_jump(scorer.system.atoms[key]):
            fewer = scorer.score(without(state, key), state.memory, state.scales)
            best = scorer.screen(fewer, lambda atom, name=name: atom.name == name)  # type: ignore[misc]
            if best:
                state = scorer.score((*fewer.keys, best[0].key), state.memory, state.scales)
    return state


def _with_jumps(scorer: Scorer, heights: Heights) -> Scorer:
    """The same problem with jumps at some heights."""
    system = scorer.system
    assert isinstance(system, RowSystem)
    blocks = [block for block in _blocks(system, heights) if block.name not in system.atoms]
    if not blocks:
        return scorer
    names = {atom.name for atom in system.atoms.values() if is_block(atom)} | set(heights)
    odds = odds_of_block(len(names)) + SHAPE_POWER * float(np.log(HEIGHTS))
    atoms = atoms_of_blocks(blocks, system.columns.shape[2], odds)
    atoms = {key: replace(atom, name=key.partition("#")[0]) for key, atom in atoms.items()}
    columns = np.concatenate([whitened(block, system.noise)[system.rows] for block in blocks], axis=2)
    return scorer.widened(system.widened(atoms, columns, np.ones(columns.shape[2])))


def _blocks(system: RowSystem, heights: Heights) -> Iterator[Block]:
    q = system.at.problem.view.q.numpy()
    letter = system.at.problem.file.machine.letter
    for name, (place, some) in heights.items():
        assert place.joint is not None
        for height in some:
            passed = (q[:, place.joint] > height).astype(float)[:, None]
            yield Block(f"{name}#{float(height)!r}", place, (f"{letter}{place.joint + 1}",), passed)
