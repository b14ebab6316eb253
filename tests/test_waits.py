"""Play that turns over with the sign of a move, and play that waits until its gap is taken up: one law, two shapes."""

import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch
from built_c import Built, Context

from ptt.challenge.challenge import bench
from ptt.correct.compensate import compensate
from ptt.correct.training.compensator import Compensator
from ptt.diagnosis.diagnose import diagnose
from ptt.diagnosis.long import diagnose_long
from ptt.diagnosis.telling.diagnosis import Diagnosis
from ptt.effects import library
from ptt.effects.reversal import AT_ONCE, WAITS, Backlash
from ptt.errors import ModelError
from ptt.fitting.kept import keep_covariance, kept_covariance
from ptt.fitting.result import FitResult
from ptt.fitting.solve import fit
from ptt.judge.ladder import rung
from ptt.judge.ladder.climb import climb
from ptt.judge.ladder.rung import fit_rung
from ptt.machine import format_machine, parse_machine
from ptt.model.chain import predict
from ptt.model.entries import read_model, write_model
from ptt.model.model import Model, Term
from ptt.run.noise import Noise
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view

SIGMA = 0.003
BACKLASH = library()["backlash"]
FILE = replace(bench(), tracker=bench().tracker.model_copy(update={"sigma_mm": SIGMA}))
AZIMUTH = np.radians(FILE.machine.slider_azimuth_deg)
OUT = np.stack([np.cos(AZIMUTH), np.sin(AZIMUTH)], axis=1)
RHO, LINK = FILE.machine.base_radius_mm - FILE.machine.platform_radius_mm, FILE.machine.link_length_mm


def heights(p: np.ndarray) -> np.ndarray:
    """Slider heights of the drawing, (n, 3) mm: |q_i|^2 + w_i^2 = L^2, sliders above."""
    across = p[:, None, :2] - RHO * OUT
    return p[:, 2:] + np.sqrt(LINK**2 - np.square(across).sum(axis=2))


def tool(b: np.ndarray) -> np.ndarray:
    """Where sliders at these heights put the tool, (n, 3) mm, by Newton steps on the same closure."""
    p = np.concatenate([np.zeros((len(b), 2)), b.mean(axis=1, keepdims=True) - np.sqrt(LINK**2 - RHO**2)], axis=1)
    for _ in range(20):
        across, w = p[:, None, :2] - RHO * OUT, p[:, 2:] - b
        slope = np.concatenate([across / w[..., None], np.ones((*w.shape, 1))], axis=2)
        p = p + np.linalg.solve(slope, (b - heights(p))[..., None])[..., 0]
    return p


def signs(b: np.ndarray) -> np.ndarray:
    """Of each move, the last one's where a slider stands; the first row arrives as the second moves."""
    sign = np.sign(np.diff(b, axis=0, prepend=2.0 * b[:1] - b[1:2]))
    for row in range(1, len(b)):
        sign[row] = np.where(sign[row] == 0.0, sign[row - 1], sign[row])
    return sign


def behind(b: np.ndarray, gap: np.ndarray, waits: bool) -> np.ndarray:
    """How far beyond its command each slider is, (n, 3) mm: the formula of the one, the recurrence of the other."""
    nut = b - 0.5 * gap * signs(b)
    for row in range(1, len(b)) if waits else ():
        nut[row] = np.clip(nut[row - 1], b[row] - 0.5 * gap, b[row] + 0.5 * gap)
    return nut - b


def helix(rows: int, turns: float) -> np.ndarray:
    way = np.linspace(0.0, 1.0, rows)
    angle = 2.0 * np.pi * turns * way
    return np.stack([45.0 * np.cos(angle), 45.0 * np.sin(angle), 60.0 * way - 30.0], axis=1)


def raster(rows: int) -> np.ndarray:
    """Lines to and fro, each a little higher."""
    line, on = np.divmod(np.arange(rows), 20)
    x = np.where(line % 2 == 0, on, 19 - on) * 100.0 / 19.0 - 50.0
    return np.stack([x, (line * 37.0) % 100.0 - 50.0, line * 60.0 / line.max() - 30.0], axis=1)


def scattered(rows: int) -> np.ndarray:
    return np.random.default_rng(7).uniform((-55.0, -55.0, -45.0), (55.0, 55.0, 45.0), (rows, 3))


PATHS = {"helix": helix(300, 6.0), "raster": raster(300), "random": scattered(300), "long": helix(1500, 12.0)}


def measured(path: str, gap: np.ndarray, waits: bool, seed: int = 3) -> Problem:
    target = PATHS[path]
    sent = heights(target)
    read = tool(sent + behind(sent, gap, waits)) + np.random.default_rng(seed).normal(0.0, SIGMA, target.shape)
    return build_problem(FILE, make_table(target, sent, measured=read, time_s=10.0 * np.arange(len(target))))


def play(gap: np.ndarray, waits: bool) -> Term:
    return Term(BACKLASH(), torch.tensor([*gap, float(waits)]))


ASKED = (("helix", 0.02, False), ("random", 0.8, True))


def told(found: Diagnosis, gap: np.ndarray, waits: bool | None) -> None:
    """It is play alone, of these gaps; where rows tell, whether it waits."""
    assert found.verdict == "missing" and found.suggested == (("backlash",),)
    theta = found.model.terms[0].theta.numpy()
    np.testing.assert_allclose(theta[:3], gap, atol=2e-3)
    assert waits is None or bool(theta[3]) is waits


@pytest.mark.parametrize(
    ("path", "gap", "waits"),
    [
        pytest.param(*case, waits, marks=() if (*case, waits) in ASKED else pytest.mark.long)
        for case in (
            ("helix", 0.02),
            ("helix", 0.8),
            ("raster", 0.06),
            ("raster", 0.4),
            ("random", 0.06),
            ("random", 0.8),
        )
        for waits in (False, True)
    ],
)
def test_what_a_diagnosis_promises_an_addition_keeps(path: str, gap: float, waits: bool) -> None:
    """Rows within a gap of a reversal are those that tell; among 300 poses at random 60 um leave hardly one of them."""
    gaps = gap * np.array([1.0, 0.7, 1.2])
    problem = measured(path, gaps, waits)
    found = diagnose(Model(FILE), problem)
    told(found, gaps, None if (path, gap) == ("random", 0.06) else waits)
    ladder = climb(Model(FILE), problem, [BACKLASH()])
    np.testing.assert_allclose(ladder.model.terms[0].theta, found.model.terms[0].theta, atol=5e-4)
    promised, kept = found.candidates[0].heldout_after, ladder.steps[-1].heldout_rms_um["total"]
    assert promised == pytest.approx(kept, rel=0.05) and kept < 1.2e3 * np.sqrt(3.0) * SIGMA
    assert found.opening.sum() <= (12 if waits else 1)  # but for the first, no row is aside that does not remember


@pytest.mark.long
def test_a_long_run_says_what_the_whole_one_says() -> None:
    gaps = np.full(3, 0.4)
    problem = measured("long", gaps, waits=False)
    for found in (diagnose(Model(FILE), problem), diagnose_long(Model(FILE), problem, size=1000)):
        told(found, gaps, waits=False)
        assert found.candidates[0].heldout_after < 1.2e3 * np.sqrt(3.0) * SIGMA


@pytest.mark.parametrize("beside", ["lead", "turn", "drift"])
def test_it_is_told_beside_another_fault(beside: str) -> None:
    target, gaps, way = PATHS["raster"], np.array([0.1, 0.06, 0.14]), np.linspace(0.0, 1.0, 300)
    sent = heights(target)
    drive = {
        "lead": np.array([2e-4, -1e-4, 1.5e-4]) * (sent - sent.mean(axis=0)),
        "turn": 0.006 * np.cos(2.0 * np.pi * sent / FILE.machine.screw_lead_mm + np.arange(3)),
        "drift": np.zeros_like(sent),
    }[beside]
    read = tool(sent + drive + behind(sent, gaps, waits=False))
    if beside == "drift":
        read = read + np.outer(way, [0.06, -0.03, 0.04])
    read = read + np.random.default_rng(5).normal(0.0, SIGMA, read.shape)
    table = make_table(target, sent, measured=read, time_s=1800.0 * way)
    found = diagnose(Model(FILE), build_problem(FILE, table))
    name = {"lead": "lead-scale", "turn": "once-per-rev", "drift": "tracker-drift"}[beside]
    assert found.verdict == "missing" and {step[0] for step in found.suggested} == {"backlash", name}
    theta = next(term.theta for term in found.model.terms if term.effect.name == "backlash").numpy()
    np.testing.assert_allclose(theta, [*gaps, 0.0], atol=2e-3)


def test_what_rows_do_not_tell_is_play_that_waits() -> None:
    """No trial is spent where no row lies within the gap: there both are the same columns."""
    view = measured("random", np.full(3, 1e-3), waits=False).view
    amounts = torch.full((3,), 1e-3, dtype=torch.float64)
    assert BACKLASH().meant_by(view, WAITS, amounts) == ()
    assert not bool(BACKLASH().meant_by(view, AT_ONCE, -amounts))
    inside = measured("helix", np.full(3, 0.5), waits=False).view
    usual, other = BACKLASH().meant_by(inside, WAITS, 500.0 * amounts)
    assert float(usual["waits"]) == 1.0 and float(other["waits"]) == 0.0
    theta, small = play(np.full(3, 0.5), True).theta, play(np.full(3, 0.5), False).theta
    waited = (BACKLASH().basis(inside, usual) @ theta[:3] - BACKLASH().shift(theta, inside)).abs().max()
    once = (BACKLASH().basis(inside, other) @ small[:3] - BACKLASH().shift(small, inside)).abs().max()
    assert float(waited) < 1e-12 and float(once) < 1e-12


def test_a_gap_below_zero_is_at_once_in_either_shape() -> None:
    view = measured("helix", np.full(3, 0.1), waits=False).view
    gap = np.array([-0.3, -0.2, -0.1])
    shifts = [BACKLASH().shift(play(gap, waits).theta, view) for waits in (True, False)]
    torch.testing.assert_close(*shifts, atol=0.0, rtol=0.0)
    np.testing.assert_allclose(shifts[0], behind(view.q.numpy(), gap, waits=False), atol=1e-12)


OLD = """
[[effect]]
name = "backlash"
[effect.parameters]
gap_mm = { value = [0.04, 0.05, 0.03], std = [1e-3, 1e-3, 1e-3] }
"""


def test_play_that_says_nothing_of_waiting_waits_and_is_written_as_it_was() -> None:
    model = read_model(parse_machine(format_machine(FILE) + OLD, "old.toml"))
    np.testing.assert_allclose(model.terms[0].theta, [0.04, 0.05, 0.03, 1.0])
    assert list(write_model(model).effect[0].parameters) == ["gap_mm"]
    assert write_model(model).effect[0].parameters["gap_mm"].std == (1e-3, 1e-3, 1e-3)
    gap = np.array([0.04, 0.05, 0.03])
    sent = heights(PATHS["helix"])
    view = build_problem(FILE, make_table(PATHS["helix"], sent, measured=PATHS["helix"])).view
    np.testing.assert_allclose(
        model.terms[0].effect.shift(model.terms[0].theta, view), behind(sent, gap, True), atol=1e-9
    )


@pytest.mark.parametrize("waits", [False, True])
def test_a_fitted_file_keeps_its_shape_and_what_its_fit_left_open(waits: bool) -> None:
    gaps = np.array([0.2, 0.15, 0.25])
    fitted = fit(Model(FILE) + BACKLASH(), measured("helix", gaps, waits))
    whole = replace(fitted.model, file=replace(fitted.model.file, covariance=keep_covariance(fitted)))
    text = format_machine(write_model(whole))
    assert ("waits" in text) is not waits
    again = read_model(parse_machine(text, "again.toml"))
    np.testing.assert_allclose(again.terms[0].theta, fitted.model.terms[0].theta)
    assert kept_covariance(again) is not None
    refit = fit(again, measured("helix", gaps, waits, seed=4)).model  # a refit holds what was given
    np.testing.assert_allclose(refit.terms[0].theta, [*gaps, float(waits)], atol=2e-3)


@cache
def turning() -> np.ndarray:
    """Targets among which many are reached by steps shorter than the gaps, each way, (n, 3) mm."""
    random = np.random.default_rng(11)
    return np.cumsum(random.normal(0.0, 0.25, (200, 3)), axis=0) + np.array([10.0, -5.0, 3.0])


@pytest.mark.parametrize("waits", [False, True])
def test_commands_mend_the_machine_that_the_model_was_fitted_to(waits: bool) -> None:
    """Re-measured on a machine of plain formulas: gaps that had shrunk to the shortest moves would leave half of it."""
    gap, goal = np.array([0.4, 0.3, 0.5]), turning()

    def missed(q: np.ndarray) -> float:
        return float(np.linalg.norm(tool(q + behind(q, gap, waits)) - goal, axis=1)[1:].max())

    exact = compensate(Model(FILE) + play(gap, waits), make_table(goal))
    fitted = climb(Model(FILE), measured("helix", gap, waits), [BACKLASH()]).model
    assert missed(heights(goal)) > 0.3 and missed(exact.q) < 1e-6
    assert missed(compensate(fitted, make_table(goal)).q) < 2.0 * SIGMA


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
@pytest.mark.parametrize(("moves", "size"), [("sliders", 1.0), ("straight", 0.1)])
def test_exported_c_sends_what_predict_sends(moves: str, size: float, tmp_path: Path) -> None:
    targets = turning() if moves == "sliders" else PATHS["helix"]
    file = replace(FILE, machine=FILE.machine.model_copy(update={"moves": moves}))
    model = Model(file) + play(size * np.array([0.4, 0.3, 0.5]), False)
    if moves == "sliders":  # a joint that turns within a straight move leaves of wind-up what no command takes
        model = model + Term(
            library()["windup"](), torch.tensor([0.02, 0.01, 0.015, 2.0, 1.0, 3.0], dtype=torch.float64)
        )
    sent = compensate(model, make_table(targets, payload_kg=1.3, temp_c=26.0))
    code, q = Built(Compensator(model, None, {}), tmp_path).commands(targets, Context(1.3, 26.0, 0.0, 0.0))
    reached = predict([(term.effect, term.theta) for term in model.terms], build_view(file, make_table(None, sent.q))).p
    assert code == 0 and float(np.abs(reached.numpy() - targets).max()) < 1e-6
    np.testing.assert_allclose(q, sent.q, rtol=0.0, atol=1e-9)


def test_words_say_that_it_turns_over_at_once() -> None:
    found = diagnose(Model(FILE), measured("helix", np.full(3, 0.2), waits=False))
    assert "backlash that turns over at once" in found.words
    names = [value.name for value in found.candidates[0].parameters]
    assert names == ["gap_mm 1", "gap_mm 2", "gap_mm 3", "waits"]
    usual = diagnose(Model(FILE), measured("helix", np.full(3, 0.2), waits=True))
    assert "at once" not in usual.words and "waits" not in [value.name for value in usual.candidates[0].parameters]


def test_a_term_need_not_say_that_play_waits_and_other_lengths_are_refused() -> None:
    gaps = torch.tensor([0.04, 0.05, 0.06], dtype=torch.float64)
    assert (Model(bench()) + Term(Backlash(), gaps)).terms[0].theta.tolist() == [0.04, 0.05, 0.06, 1.0]
    with pytest.raises(ModelError, match="has 4 values, not 2"):
        Model(bench()) + Term(Backlash(), gaps[:2])


def test_a_rung_asks_for_the_form_that_the_first_fit_did_not_take(monkeypatch: pytest.MonkeyPatch) -> None:
    """As gross errors may have it, the first fit takes play that turns over at once."""
    problem, links = measured("raster", np.full(3, 0.1), waits=True), library()["link-length"]

    def led_astray(model: Model, rows: Problem, noise: Noise | None = None) -> FitResult:
        new = any(not len(term.theta) for term in model.terms)
        return fit(Model(FILE) + links() + play(np.full(3, 0.1), False) if new else model, rows, noise=noise)

    monkeypatch.setattr(rung, "fit", led_astray)
    told = fit_rung(Model(FILE) + links() + BACKLASH(), problem, None)
    found = {term.effect.key: term.theta for term in told.model.terms}
    np.testing.assert_allclose(found["backlash"], [0.1, 0.1, 0.1, 1.0], atol=2e-3)
