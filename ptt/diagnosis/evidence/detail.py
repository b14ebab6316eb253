"""Effects with their fine detail as atoms: a rough curve is then one cause, not an unknown of each joint's travel."""

from dataclasses import replace

import numpy as np

from ptt.diagnosis.evidence.atoms import EFFECT_ODDS
from ptt.diagnosis.evidence.effect_atoms import effect_atom, straight_sizes
from ptt.diagnosis.evidence.row_system import rows_of
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.evidence.system import System
from ptt.fitting.linear import detailed_columns
from ptt.run.problem import Problem


def follows_travel(state: State, system: System, problem: Problem) -> bool:
    """Whether a set has an unknown that depends on the travel of the joint at which it acts."""
    blocks = [block for key in state.keys if (block := system.atoms[key].block) is not None]
    letter = problem.file.machine.letter
    return any(block.place.joint is not None and block.on == (f"{letter}{block.place.joint + 1}",) for block in blocks)


def with_detail(scorer: Scorer, problem: Problem) -> Scorer:
    """Add atoms for the effects that have fine detail, with all of it.

    That a curve is there and that it is rough are two statements, so such an atom costs a second name: else a spot or a
    step of one joint would be named as a rough curve.

    Args:
        scorer: of a linearised problem.
        problem: its readings.

    Returns:
        A scorer that keeps what was scored before.
    """
    system = rows_of(scorer.system)
    for atom in list(system.atoms.values()):
        if atom.effect is None or atom.shape is None or not any(p.fine for p in atom.effect.parameters):
            continue
        columns, sizes = detailed_columns(system.at, atom.effect, atom.shape)
        straight = straight_sizes(atom.effect, problem)[: len(sizes)]
        place, odds = np.arange(len(sizes)), atom.odds + EFFECT_ODDS
        rough = effect_atom(f"{atom.key} in detail", place, atom.effect, problem, odds, atom.shape)
        own = {rough.key: replace(rough, tested=atom.tested)}
        system = system.widened(own, (columns * straight)[system.rows], sizes * straight)
    return scorer.widened(system)
