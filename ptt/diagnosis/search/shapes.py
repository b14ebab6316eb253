"""Further shapes of effects as atoms beside those that a problem was linearised with."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch

from ptt.diagnosis.evidence.atoms import Atom, is_sudden
from ptt.diagnosis.evidence.effect_atoms import reshaped
from ptt.diagnosis.evidence.row_system import rows_of
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State, without
from ptt.effects.layout import shape_of
from ptt.fitting.linear import Shape
from ptt.fitting.result import FitResult
from ptt.run.problem import Problem


def with_moments(scorer: Scorer, moments: Sequence[Shape]) -> Scorer:
    """A scorer with atoms of further moments for all sudden effects."""
    sudden = {atom.name for atom in scorer.system.atoms.values() if is_sudden(atom)}
    return with_shapes(scorer, dict.fromkeys(sudden, moments) if moments else {})


def with_shapes(scorer: Scorer, shapes: Mapping[str, Sequence[Shape]]) -> Scorer:
    """A scorer with atoms of further shapes of its effects, at the odds of the present ones.

    Args:
        scorer: of a linearised problem.
        shapes: effect -> its further shapes.

    Returns:
        A scorer that knows what was scored before.
    """
    system, atoms = rows_of(scorer.system), dict[str, Atom]()
    columns, base = list[np.ndarray](), list[np.ndarray]()
    like = {atom.name: atom for atom in system.atoms.values() if atom.shape is not None and atom.name in shapes}
    for name, atom in like.items():
        assert atom.effect is not None
        by_key = {shape_key(name, shape): shape for shape in shapes[name]}
        new = {key: shape for key, shape in by_key.items() if key not in system.atoms}
        if not new:
            continue
        columns.append(system.at.columns(atom.effect, *new.values())[system.rows])
        base.append(system.at.on_base(atom.effect, *new.values()))
        atoms |= {key: reshaped(atom, key, shape) for key, shape in new.items()}
    size = [system.scale[like[atom.name].columns] for atom in atoms.values()]
    if atoms:
        rows, on_base = (np.concatenate(own, axis=2) for own in (columns, base))
        system = system.widened(atoms, rows, np.concatenate(size), on_base)
    return scorer.widened(system)


def with_other_meanings(scorer: Scorer, fitted: FitResult, problem: Problem) -> Scorer:
    """A scorer with the model's effects also in other given shapes, as alternatives to the present ones.

    A given parameter (such as what a row's speed means) is chosen before other effects are named, and no fit changes
    it, nor brings in a shape that a search left at its default; another choice may be better once play is named.
    Moments of sudden effects are treated by `best_moments`.

    Args:
        scorer: of a linearised problem.
        fitted: the model that it was linearised at.
        problem: its readings.

    Returns:
        A scorer that knows what was scored before.
    """
    system = rows_of(scorer.system)
    for term in fitted.model.terms:
        key, effect = term.effect.key, term.effect
        stems = {each.stem for each in effect.parameters if each.role == "given" or each.default is not None}
        shapes = [shape for shape in effect.search(problem.view) if set(shape) == stems]
        if (
            key in scorer.given
            or key not in system.atoms
            or not stems
            or len(shapes) < 2
            or is_sudden(system.atoms[key])
        ):
            continue
        own = shape_of(effect, term.theta, problem.view.joints)
        others = [shape for shape in shapes if any(not torch.equal(shape[stem], own[stem]) for stem in stems)]
        columns = system.at.columns(effect, *others)[system.rows]
        if columns.shape[2] != len(others) * len(system.atoms[key].columns):  # some of its values are held
            continue
        by_key = {shape_key(key, shape): shape for shape in others}
        atoms = {each: reshaped(system.atoms[key], each, shape, own) for each, shape in by_key.items()}
        sizes = np.tile(system.scale[system.atoms[key].columns], len(others))
        system = system.widened(atoms, columns, sizes, system.at.on_base(effect, *others))
    return scorer.widened(system)


def best_meanings(scorer: Scorer, state: State) -> State:
    """The set with each effect of the model in the best of its given shapes."""
    atoms = scorer.system.atoms
    for key in state.keys:
        if atoms[key].effect is None or atoms[key].shape is not None:
            continue
        others = [other for other in atoms.values() if other.name == atoms[key].name and other.key != key]
        fewer = without(state, key)
        tried = [scorer.score([*fewer, other.key], state.memory, state.variances) for other in others]
        state = max([state, *tried], key=lambda each: each.total)
    return state


def shape_key(name: str, shape: Shape) -> str:
    """Key of an effect in a shape, made of the shape's values, so that scores of shapes are never confused."""
    return f"{name}#{', '.join(f'{stem} {value.tolist()}' for stem, value in sorted(shape.items()))}"
