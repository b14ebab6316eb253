"""Diagnosis of a long run: it is explained on stretches, then fitted, searched on and tested on all rows."""

from dataclasses import replace

from ptt.diagnosis.evidence.ansatz import open_long_run
from ptt.diagnosis.evidence.sampled import share_of_rows
from ptt.diagnosis.evidence.state import without
from ptt.diagnosis.noise.memory import WHITE
from ptt.diagnosis.search.everywhere import WholeSearch, find_everywhere
from ptt.diagnosis.search.find import MOST_ADDED, find
from ptt.diagnosis.search.found import Found
from ptt.diagnosis.search.rest import Rest, innovations_of, rest_left
from ptt.diagnosis.telling.bins import follow_in_all_rows
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.diagnosis.telling.given import as_free_as, prepare
from ptt.diagnosis.telling.other_setups import with_other_setups
from ptt.diagnosis.telling.verdict import conclude
from ptt.diagnosis.unknown.span import Span, span_of
from ptt.effects import Library
from ptt.fitting.chunks import CHUNK, cut, numbers, sample_stretches, take
from ptt.model.model import Model
from ptt.progress import Tell
from ptt.run.problem import Problem

# Rows of the sample on which shapes and unknowns are found, and rows beyond which a run is summed up in chunks. For a
# 3-PTT, columns of all rows at once take gigabytes and minutes (4.4 GB at 30,000 rows); sums take 1.8 GB and 20 s. An
# arm's sets are ten times as large, as every joint has a curve and four lengths: 1,500 rows of a UR10 take a minute,
# 3,000 take ten.
LONG_SAMPLE_ROWS = {"three-ptt": 4_000, "serial": 1_000}
MOST_WHOLE_ROWS = {"three-ptt": CHUNK, "serial": 2_000}
LONG_STRETCH_ROWS = {"three-ptt": 200, "serial": 50}  # rows of one stretch of travel, of which a sample has twenty


def chunk_size(problem: Problem, asked: int | None = None) -> int | None:
    """Rows that a run is summed up by at a time.

    Args:
        problem: the readings.
        asked: rows of a chunk; None leaves it to the run, which is then cut only beyond `MOST_WHOLE_ROWS` rows.

    Returns:
        Rows of a chunk; None where all rows are looked at as a whole.
    """
    if asked is None and problem.table.rows <= MOST_WHOLE_ROWS[problem.file.machine.kind]:
        return None
    return asked or CHUNK


def diagnose_long(
    model: Model,
    problem: Problem,
    known: Library | None = None,
    *,
    steps: int = MOST_ADDED,
    progress: Tell | None = None,
    size: int = CHUNK,
    sample_rows: int | None = None,
) -> Diagnosis:
    """Learn which physical effects are missing from a run whose columns do not fit into memory.

    What explains the run is found on stretches of travel that are spread over it and entered as the run enters them.
    Then effects, beside them blocks and memory of the noise that the stretches show, are fitted and searched on by
    sums over all rows, with the same scores; gross errors, held-out errors and the verdict are of all rows. Of a very
    long run candidates are told by a share of the rows, as in `ptt.diagnosis.evidence.sampled`.

    Args:
        model: the model as given.
        problem: the readings.
        known: effects by name; None for the library.
        steps: how many may be added.
        progress: told what is being done.
        size: rows of a chunk.
        sample_rows: about how many rows the explanation is found on; None: as many as suit the kind of machine.

    Returns:
        The diagnosis.

    Raises:
        TableError: nothing tells the noise floor, or too few readings for any verdict.
    """
    given, whole, tell = model, problem, progress or (lambda what: None)
    model, problem, known, opening = prepare(model, problem, known)
    span = span_of(problem)
    kind = problem.file.machine.kind
    sample = take(problem, sample_stretches(problem, sample_rows or LONG_SAMPLE_ROWS[kind], LONG_STRETCH_ROWS[kind]))
    told = find(model, sample, known, tell, steps, span)
    run = open_long_run(problem, cut(problem, size), _with_levers(span, told))
    found = find_everywhere(told, WholeSearch(run, sample, model, known, steps, tell))
    tell("rest")
    rest = _rest(found, problem)
    if rest.significant and (new := _new(found, told)):  # what leaves a rest is not named for all rows' sake alone
        fewer = without(found.state, *new)
        found = replace(found, state=found.scorer.score(fewer, found.state.memory, found.state.variances))
        rest = _rest(found, problem)
    result = conclude(found, rest, model, problem, known, tell, steps)
    how = (
        f"Shapes, the unknown, the noise and the tests of the remaining error against repeats and position come from "
        f"{sample.table.rows} rows in stretches of travel; parameters, the search around them, held-out errors, gross "
        f"errors and what the remaining error depends on come from all rows, processed in chunks of {size}."
    )
    times = share_of_rows(problem.table.rows)
    if times > 1 and found.state.memory == WHITE:
        how += f" What else may be missing was searched for in one row in {times}."
    result = replace(result, model=as_free_as(given, result.model), opening=opening)
    return with_other_setups(result, given, whole, f" {how}")


def _new(found: Found, told: Found) -> list[str]:
    """Effects that only all rows show."""
    known = {told.system.atoms[key].name for key in told.state.keys}
    atoms = found.system.atoms
    return [key for key in found.state.keys if key not in found.scorer.given and atoms[key].name not in known]


def _with_levers(span: Span, told: Found) -> Span:
    """The span with the levers that the sample's blocks have."""
    places = [atom.block.place for atom in told.system.atoms.values() if atom.block is not None]
    return replace(span, levers={place.residual: place.lever for place in places})


def _rest(found: Found, problem: Problem) -> Rest:
    """Tests of what the explanation leaves: on the sample, and of bins over all rows."""
    assert found.sample is not None
    residual = innovations_of(found.system, found.state, problem)
    rest = rest_left(residual[numbers(found.sample)], found.state, found.sample.with_noise(found.system.noise))
    rows = found.system.rows
    more = follow_in_all_rows(problem, residual, found.system.noise, rows)
    if found.state.memory.wander is not None:  # as in the sample's tests
        more = [(name, share) for name, share in more if name not in ("time", "run")]
    reasons = [
        f"over all rows the remaining error depends on {name} ({share:.1%} of its variance)" for name, share in more
    ]
    return replace(rest, reasons=(*rest.reasons, *reasons))
