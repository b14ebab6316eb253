"""Normal sums of a long run, chunk by chunk, and residuals of its rows by a further pass over them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ptt.diagnosis.evidence.ansatz import Ansatz, LongRun, Trials, columns_of
from ptt.diagnosis.evidence.effect_atoms import atoms_of
from ptt.diagnosis.evidence.sampled import Held, share_of_rows, spread
from ptt.diagnosis.evidence.summed_system import SummedSystem
from ptt.diagnosis.evidence.system import clock_of
from ptt.diagnosis.noise.gross import gross_errors, places_of
from ptt.diagnosis.noise.memory import WHITE, as_sums, base_sums, block_sums, sum_rows
from ptt.effects import Effect
from ptt.fitting.chunks import cut, map_chunks, numbers
from ptt.fitting.linear import Linear, Shape, few_shapes
from ptt.fitting.outliers import inside
from ptt.run.problem import Problem

SLAB_ROWS = 4_000  # rows of a chunk whose columns of all candidates are held at once: more of them leave the cache
# Contiguous stretches of held-out blocks in a chunk, up to which slicing them (which copies nothing) is faster.
MOST_STRETCHES = 50


@dataclass(frozen=True)
class Contribution:
    """Sums of one chunk of m rows; those of different chunks are added.

    Attributes:
        by_block: held-out block -> its sums in noise units and in mm, and its rows.
        share: the same over the subsample for candidates (`sampled`); empty where these are summed over all rows.
        other: sums under the memory of the noise and half its log-determinant; None for white noise.
        rows: rows that count, (m,) bool.
        gross: rows left out as gross errors, (m,) bool.
        linear: description of the columns, without their rows.
    """

    by_block: dict[int, Held]
    share: dict[int, Held]
    other: tuple[np.ndarray, float] | None
    rows: np.ndarray
    gross: np.ndarray
    linear: Linear


def sum_up(
    run: LongRun, at: Ansatz, trials: Trials, sample: Problem, kept: np.ndarray, *, sift: bool = False,
) -> tuple[SummedSystem, np.ndarray]:  # fmt: skip
    """Sum up all chunks.

    Args:
        run: the long run.
        at: where its chunks are linearised.
        trials: candidates.
        sample: some rows of the run, on which effects list their shapes.
        kept: rows that may count, (n,) bool.
        sift: look for gross errors; the candidates then only serve to recognise them.

    Returns:
        The system, and rows left out as gross errors, (n,) bool.
    """

    def work(chunk: Problem) -> Contribution:
        return sum_chunk(chunk, run, at, trials, kept, sift)

    by_block, share = dict[int, Held](), dict[int, Held]()
    other: tuple[np.ndarray, float] | None = None
    rows, gross = [], []
    for part in map_chunks(work, run.chunks):
        for sums, more in ((by_block, part.by_block), (share, part.share)):
            for index, held in more.items():
                _add(sums, index, held)
        if part.other is not None:
            other = part.other if other is None else (other[0] + part.other[0], other[1] + part.other[1])
        rows.append(part.rows)
        gross.append(part.gross)
    linear = part.linear
    if share:
        own, end = len(at.fitted.unknowns), next(iter(share.values()))[0].shape[0]
        behind = end - 1 - sum(len(atom.columns) for atom in at.blocks)
        by_block = spread(by_block, share, np.concatenate([np.arange(own), np.arange(behind, end)]))
    system = _system(run, at, {} if sift else trials, sample, linear, np.concatenate(rows), by_block, other)
    return system, np.concatenate(gross)


def sum_chunk(chunk: Problem, run: LongRun, at: Ansatz, trials: Trials, kept: np.ndarray, sift: bool) -> Contribution:
    """Linearise one chunk and sum it up.

    Args:
        chunk: its rows, entered as the chunk before left them.
        run: the run.
        at: where it is linearised.
        trials: candidates.
        kept: rows that may count, (n,) bool.
        sift: as in `sum_up`.

    Returns:
        The chunk's part.
    """
    by_block, share = dict[int, Held](), dict[int, Held]()
    rows, gross, joined = list[np.ndarray](), list[np.ndarray](), list[np.ndarray]()
    times = share_of_rows(run.problem.table.rows) if at.memory == WHITE and trials and not sift else 1
    for part in [chunk] if sift else (make() for make in cut(chunk, SLAB_ROWS)):
        linear, columns = columns_of(part, run, at, {} if sift or times > 1 else trials)
        there = linear.rows & kept[numbers(part)]
        far = _gross(part, run, at, trials, linear, columns, there) if sift else np.zeros_like(there)
        there = there & ~far
        both = _sum_rows(part, run, at, linear, columns, there, by_block)
        if at.memory != WHITE:  # which goes on from one slab into the next
            joined.append(both)
        if times > 1:
            # Another part of each slab, or on a cycle as long as a slab the same poses would always be left out.
            some = cut(part, -(-part.table.rows // times))
            few = some[int(numbers(part)[0]) // SLAB_ROWS % len(some)]()
            linear, columns = columns_of(few, run, at, trials)
            _sum_rows(few, run, at, linear, columns, linear.rows & kept[numbers(few)], share)
        rows.append(there)
        gross.append(far)
    other, counted = None, np.concatenate(rows)
    if at.memory != WHITE:
        clock = replace(clock_of(chunk, counted), registered=False)  # a chunk starts within a run, not at registration
        other = sum_rows(np.concatenate(joined), at.memory, clock, run.pose[numbers(chunk)[counted]])
    return Contribution(by_block, share, other, counted, np.concatenate(gross), linear.without_rows())


def _sum_rows(
    part: Problem, run: LongRun, at: Ansatz, linear: Linear, columns: np.ndarray, there: np.ndarray,
    by_block: dict[int, Held],
) -> np.ndarray:  # fmt: skip
    """Add sums of the r rows that count to their held-out blocks; returns their columns and readings, (r, 3, P + 1)."""
    both = np.concatenate([columns, linear.values[:, :, None]], axis=2)
    both = both if there.all() else both[there]
    for index, stretch in _stretches(run.block[numbers(part)[there]]):
        _add(by_block, index, block_sums(both[stretch], at.noise))
    return both


def residual_of_rows(
    run: LongRun, at: Ansatz, system: SummedSystem, chosen: np.ndarray, values: np.ndarray
) -> np.ndarray:
    """Residual of a solution on all m rows that count, by a pass over the chunks.

    Args:
        run: the run.
        at: where it was linearised.
        system: the sums.
        chosen: indices of the columns, (p,).
        values: of the columns, (p,).

    Returns:
        (m, 3) whitened.
    """
    there = [atom for atom in system.atoms.values() if np.isin(atom.columns, chosen).any()]
    names = [atom.name for atom in there if atom.block is not None]
    few: dict[str, tuple[Effect, list[Shape]]] = {}
    for atom in there:
        if atom.effect is not None and atom.shape is not None:
            few.setdefault(atom.effect.key, (atom.effect, []))[1].append(atom.shape)
    own = [atom.columns for atom in there if atom.shape is not None or atom.block is not None]
    index = np.concatenate([np.arange(len(at.fitted.unknowns)), *own]).astype(int)
    place, counted = np.searchsorted(index, chosen), np.zeros(run.problem.table.rows, dtype=bool)
    counted[system.rows] = True

    def work(chunk: Problem) -> np.ndarray:
        linear, columns = columns_of(chunk, run, at, few, names)
        return (linear.values - columns[:, :, place] @ values)[counted[numbers(chunk)]]

    return np.concatenate(list(map_chunks(work, run.chunks)))


def _add(by_block: dict[int, Held], index: int, own: Held) -> None:
    """Add the sums of some rows to those of their held-out block."""
    if index not in by_block:
        by_block[index] = own
        return
    white, in_mm, rows = by_block[index]
    white += own[0]
    in_mm += own[1]
    by_block[index] = white, in_mm, rows + own[2]


def _stretches(block: np.ndarray) -> Iterator[tuple[int, slice | np.ndarray]]:
    """Rows of each held-out block: as slices, which copy nothing, unless these are many and short."""
    edges = np.flatnonzero(np.diff(block, prepend=-2, append=-2))
    if len(edges) - 1 > MOST_STRETCHES:
        yield from ((int(index), np.flatnonzero(block == index)) for index in np.unique(block))
    else:
        yield from ((int(block[first]), slice(first, last)) for first, last in pairwise(edges.tolist()))


def _gross(
    chunk: Problem, run: LongRun, at: Ansatz, trials: Trials, linear: Linear, columns: np.ndarray, rows: np.ndarray
) -> np.ndarray:
    """Isolated rows of a chunk that neither the model and its blocks nor all candidates explain, (m,) bool."""
    simple = np.arange(columns.shape[2])
    if inside(linear.residual, rows)[rows].all():
        return np.zeros_like(rows)
    wider, everything = columns_of(chunk, run, at, trials)
    own = np.concatenate([wider.simple, np.arange(wider.columns.shape[2], everything.shape[2])])
    assert len(own) == len(simple)
    return gross_errors(everything, wider.values, rows, own, few_shapes(wider.trials, own), places_of(chunk))


def _system(
    run: LongRun, at: Ansatz, trials: Trials, sample: Problem, linear: Linear, rows: np.ndarray,
    by_block: dict[int, Held], other: tuple[np.ndarray, float] | None,
) -> SummedSystem:  # fmt: skip
    counts = {key: len(tuple(effect.search(sample.view))) for key, (effect, _) in trials.items()}
    linear = replace(linear, trials=tuple(replace(t, trials=counts[t.effect.key]) for t in linear.trials))
    atoms = atoms_of(linear, at.fitted, sample, [effect for effect, _ in trials.values()])
    place = len(linear.scale)
    for atom in at.blocks:
        atoms[atom.key] = replace(atom, columns=np.arange(place, place + len(atom.columns)))
        place += len(atom.columns)
    base = base_sums(np.pad(linear.base_columns, [(0, 0), (0, 0), (0, place - len(linear.scale))]), linear.base_values)
    white = sum((own[0] for own in by_block.values()), base)
    total = {WHITE: as_sums(white, 0.0)}
    if other is not None:
        total[at.memory] = as_sums(other[0] + base, other[1])
    scale = np.concatenate([linear.scale, np.ones(place - len(linear.scale))])
    there, pose = np.flatnonzero(rows), run.pose[rows]
    system = SummedSystem(
        there, linear.frame, atoms, clock_of(run.problem, rows), at.noise, at.freedom, scale, total, by_block,
        linear.base_values.size, len(pose) - len(np.unique(pose)), lambda chosen, values: np.zeros((0, 3)),
        by_visit=run.by_visit, rounding_mm=run.problem.rounding[1],
    )  # fmt: skip
    system.residual_by_pass = lambda chosen, values: residual_of_rows(run, at, system, chosen, values)
    return system
