"""Where a new effect starts: rows that only its right shape explains are no gross errors."""

from ptt.challenge.hide import hide_faults
from ptt.challenge.truth import find_truth
from ptt.effects import library
from ptt.effects.registry import make_effect
from ptt.fitting.solve import fit
from ptt.model.model import Model
from ptt.rig.draw_foreign_arm import draw_foreign_arm


def test_a_slip_is_found_at_its_moment_where_few_rows_show_it() -> None:
    """Each joint is swept in turn: one that slips is seen in its own sweep alone."""
    drawn = draw_foreign_arm(1, "volume", path="one-joint", rows=150, noise="white")
    truth = find_truth(hide_faults(drawn, ["homing-slip"], 1), library())
    model = Model(truth.problem.file) + make_effect(library(), "homing-slip")
    fitted = fit(model, truth.problem, robust=False, noise=truth.noise, lean=True)
    assert fitted.chi2 < 1.0  # the truth is without noise
