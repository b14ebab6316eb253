"""Further shapes of effects beside those that a problem was linearised with."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ptt.diagnosis.atoms import Atom, is_sudden
from ptt.diagnosis.row_system import RowSystem
from ptt.diagnosis.score import Scorer
from ptt.fitting.linear import Shape


def with_moments(scorer: Scorer, moments: Sequence[Shape]) -> tuple[Scorer, RowSystem]:
    """The same problem with further moments for all that is sudden; returns as `with_shapes`."""
    sudden = {atom.name for atom in scorer.system.atoms.values() if is_sudden(atom)}
    return with_shapes(scorer, dict.fromkeys(sudden, moments) if moments else {})


def with_shapes(scorer: Scorer, shapes: Mapping[str, Sequence[Shape]]) -> tuple[Scorer, RowSystem]:
    """The same problem with further shapes of its effects, at the price of those that it has.

    Args:
        scorer: of a linearised problem.
        shapes: effect -> its further shapes.

    Returns:
        A scorer that knows what was scored before, and its system.
    """
    system, atoms = scorer.system, dict[str, Atom]()
    columns, base = list[np.ndarray](), list[np.ndarray]()
    assert isinstance(system, RowSystem)
    like = {atom.name: atom for atom in system.atoms.values() if atom.shape is not None and atom.name in shapes}
    first = system.columns.shape[2]
    for name, atom in like.items():
        assert atom.effect is not None
        by_key = {shape_key(name, shape): shape for shape in shapes[name]}
        new = {key: shape for key, shape in by_key.items() if key not in system.atoms}
        if not new:
            continue
        columns.append(system.at.columns(atom.effect, *new.values())[system.rows])
        base.append(system.at.on_base(atom.effect, *new.values()))
        for key, shape in new.items():
            place = np.arange(first, first + len(atom.columns))
            atoms[key], first = replace(atom, key=key, columns=place, shape=dict(shape)), first + len(place)
    size = [system.scale[like[atom.name].columns] for atom in atoms.values()]
    if atoms:
        rows, on_base = (np.concatenate(own, axis=2) for own in (columns, base))
        system = system.widened(atoms, rows, np.concatenate(size), on_base)
    return scorer.widened(system), system


def shape_key(name: str, shape: Shape) -> str:
    """Of an effect in a shape, by its values: what was scored of one shape is never taken for what another says."""
    return f"{name}#{', '.join(f'{stem} {value.tolist()}' for stem, value in sorted(shape.items()))}"
