"""Effects that do far more than the whole error, because others cancel them, are stand-ins before they are physics."""

from dataclasses import replace

import numpy as np
import pytest
from made_runs import SIGMA, empty_run, machine, measure, term

from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.evidence import cancelled
from ptt.diagnosis.evidence.linearised import build_row_system
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.noise.memory import WHITE
from ptt.effects import library
from ptt.effects.registry import make_effect
from ptt.fitting.solve import fit
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.run.noise import Noise
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

ROWS, AT = 200, 995.0  # readings, and when something happens, s


def shifted(back: float, play: float = 0.0) -> Problem:
    """Readings of a machine one slider of which slips, while a knock of the tracker takes back this share of it.

    Args:
        back: that share.
        play: of all sliders, mm, beside.
    """
    random, file = np.random.default_rng(1), machine()
    table = make_table(random.uniform(-90.0, 90.0, (ROWS, 3)), time_s=10.0 * np.arange(ROWS))
    view = build_view(file, table)
    slip = term("homing-slip", view, [-0.2, 0.0, 0.0], after=AT)
    nowhere, there = (predict(terms, view).reading.numpy() for terms in ([], [(slip.effect, slip.theta)]))
    reading = there - back * (there - nowhere)[ROWS // 2 :].mean(axis=0) * (np.arange(ROWS) >= ROWS // 2)[:, None]
    play_too = term("backlash", view, [play, play, play])
    reading = reading + (predict([(play_too.effect, play_too.theta)], view).reading.numpy() - nowhere)
    return build_problem(file, replace(table, measured=reading + random.normal(0.0, SIGMA, (ROWS, 3))))


@pytest.mark.parametrize(
    ("back", "play", "fined"), [(-1.0, 0.0, False), (0.0, 0.0, False), (1.0, 0.0, True), (1.0, 0.3, True)]
)
def test_the_score_is_against_causes_that_cancel(
    back: float, play: float, fined: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However much the model as given explains beside them, as play that is known."""
    problem, noise = shifted(back, play), Noise(np.eye(3) * SIGMA**2, "machine file")
    known = (term("backlash", problem.view, [play, play, play]),) if play else ()
    model = Model(problem.file, known)
    fitted = fit(model, problem, noise=noise, robust=False)
    events = [make_effect(library(), name) for name in ("homing-slip", "setup-jump")]
    system, totals = build_row_system(fitted, problem, events, noise, 1e3, problem.used), list[float]()
    for rate in (cancelled.NATS_PER_TIME, 0.0):
        monkeypatch.setattr(cancelled, "NATS_PER_TIME", rate)
        scorer = Scorer(system, model.keys)
        totals.append(scorer.score([_nearest(scorer, event.key) for event in events], WHITE).total)
    assert (totals[1] - totals[0] > 10.0) if fined else (totals[1] == totals[0])


def _nearest(scorer: Scorer, name: str) -> str:
    atoms = scorer.system.atoms
    return min((key for key in atoms if atoms[key].name == name), key=lambda key: abs((atoms[key].moment or 0.0) - AT))


def test_what_nothing_else_explains_is_named_though_it_cancels() -> None:
    problem = shifted(1.0)
    found = diagnose(Model(problem.file), problem)
    assert found.verdict == "missing" and {names[0] for names in found.suggested} == {"homing-slip", "setup-jump"}


@pytest.mark.parametrize("lost", [0, 1])
def test_a_run_without_a_reading_says_nothing_of_its_own_frame(lost: int) -> None:
    file, table = machine(frame="fitted-per-run"), empty_run(150)
    table = table.replace(run=np.arange(150) // 50, run_label=("a", "b", "c"))
    view = build_view(file, table)
    read = measure(
        table, file, [term("backlash", view, [0.03, 0.05, 0.02]), term("link-length", view, [0.0, 0.3, 0.0])]
    )
    blank = np.where((table.run == lost)[:, None], np.nan, read.measured)
    found = diagnose(Model(file), build_problem(file, read.replace(measured=blank)))
    assert {step[0] for step in found.suggested} == {"backlash", "link-length"}
