"""What is sent to a machine of names that stand beside an unknown."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from made_runs import machine, term

from ptt.diagnosis.evidence.linearised import build_row_system
from ptt.diagnosis.evidence.score import Scorer
from ptt.diagnosis.evidence.state import State
from ptt.diagnosis.noise.memory import WHITE, Memory
from ptt.diagnosis.noise.wander import Wander
from ptt.diagnosis.telling.terms import sent_state
from ptt.effects import library
from ptt.effects.registry import make_effect
from ptt.fitting.solve import fit
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.run.noise import Noise
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

NOISE = 0.003  # mm, of one axis


def test_no_memory_of_the_noise_keeps_what_is_sent_from_the_readings() -> None:
    """A link is 60 um too long, and the tool stands to one side by as much each time y rises: no known effect.

    Without the unknown beside it the rest is twenty times the noise. A wander of twice the noise's variance is as much
    of that, and would explain the mean shift, which only the link does.
    """
    file = machine(frame="trusted", tool="trusted")
    angle, random = np.tile(np.linspace(0.0, 2.0 * np.pi, 30, endpoint=False), 10), np.random.default_rng(1)
    table = make_table(
        np.column_stack([40.0 * np.cos(angle), 30.0 * np.sin(angle), np.full(300, -20.0)]),
        time_s=12.0 * np.arange(300),
    )
    view = build_view(file, table)
    link = term("link-length", view, [0.06, 0.0, 0.0])
    reading = predict([(link.effect, link.theta)], view).reading.numpy() + random.normal(0.0, NOISE, (300, 3))
    reading[:, 0] += 0.06 * np.sign(np.cos(angle))
    problem, noise = build_problem(file, replace(table, measured=reading)), Noise(np.eye(3) * NOISE**2, "machine file")
    fitted = fit(Model(file), problem, noise=noise, robust=False)
    candidates = [make_effect(library(), name) for name in ("link-length", "once-per-rev")]
    scorer = Scorer(build_row_system(fitted, problem, candidates, noise, 1e3, problem.used))
    atoms = scorer.system.atoms
    names = tuple(next(key for key in atoms if atoms[key].name == effect.name) for effect in candidates)
    unknown = next(key for key in atoms if key == "slider 1 on b1")

    def error(state: State) -> float:
        left = scorer.system.in_mm(scorer.system.residual(state.columns, state.posterior.values))
        return float(np.sqrt(np.square(left).sum(axis=1).mean()))

    beside = scorer.score((*names, unknown), Memory(Wander(2.0, 800.0)))
    sent = sent_state(SimpleNamespace(scorer=scorer, state=beside, system=scorer.system), names)
    drawing = error(scorer.score((), WHITE))
    assert error(sent) < 0.5 * drawing < 0.5 * error(scorer.score(names, beside.memory))
