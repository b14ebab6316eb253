"""What is said of steps, ties, unknowns and verdicts."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_effects_words import KNOWN, SIGMA, fault, hide

from ptt.challenge.challenge import bench as bench_machine
from ptt.diagnosis.evidence.at_tool import at_tool_um
from ptt.diagnosis.noise.slow import Slow
from ptt.diagnosis.noise.wander import Wander
from ptt.diagnosis.telling.verdict_words import explain_verdict
from ptt.diagnosis.telling.words import explain_step
from ptt.fitting.solve import fit
from ptt.model.model import Model
from ptt.run.noise import Noise

MACHINE = bench_machine()
NOISE = Noise(np.eye(3) * SIGMA**2, "machine file")


def candidate(**values):
    return SimpleNamespace(**{"effect": "a", "words": "A.", "sum_of": (), **values})


def diagnosis(verdict, *, steps=0, ties=(), depends=0, reasons=("the readings scatter",), wander=None, after=0.3,
              probability=0.9, terms=(), perhaps=(), oversized=(), **on):  # fmt: skip
    found = {
        "residual": "slider 2",
        "on": "b2",
        "share": 0.4,
        "together": (),
        "alone_share": None,
        "period_mm": 3.1,
        "shape": "smooth",
        "place": None,
        "moments": (),
    }
    found = SimpleNamespace(
        **{**found, "with_": None, "rivals": (), "acts_on": None, "unit": "mm", "words": "It is large.", **on}
    )
    return SimpleNamespace(
        verdict=verdict,
        verdict_probability={"unknown": 1.0 - probability, verdict: probability},
        suggested=[(term.effect.key,) for term in terms] or [(f"effect-{number}", *ties) for number in range(steps)],
        model=SimpleNamespace(terms=terms),
        candidates=[candidate(words=f"Words of {number}.") for number in range(steps + 9)],
        depends_on=[found] * depends,
        rest=SimpleNamespace(reasons=reasons),
        noise=NOISE,
        rms_um={"before": {"total": 90.0}, "after": {"total": after}},
        rows=110,
        not_testable={},
        wander=wander,
        elsewhere=None,
        perhaps=perhaps,
        oversized=oversized,
    )


def test_a_tie_comes_first_and_nothing_else_does_not_stand_beside_it(tmp_path):
    problem = hide(tmp_path, fault("drive", "backlash_mm", 2, 0.05))
    term = fit(Model(problem.file) + KNOWN["backlash"](), problem, noise=NOISE).model.terms[0]
    tied = explain_step(term, ("windup", "joint-clearance"), (), (62.0, 9.0), NOISE, problem)
    assert tied.startswith(
        "Either backlash, windup or joint-clearance: this data cannot tell them apart. Taken as backlash: s"
    )
    assert "Nothing else" not in tied
    summed = explain_step(term, (), ("lead-scale", "link-length"), (62.0, 9.0), NOISE, problem)
    assert summed.startswith("Either backlash, or lead-scale and link-length together would do the same: this data")
    assert "Nothing else" not in summed
    alone = explain_step(term, (), (), (62.0, 9.0), NOISE, problem, after=("windup",))
    assert "Nothing else explains it as well; the held-out error after windup falls from 62.0 to 9.0 um" in alone


def test_values_beyond_the_error_come_with_what_they_do_at_the_tool(tmp_path):
    """A length is no error of the tool; where effects cancel one another, that is said."""
    problem = hide(tmp_path, fault("drive", "backlash_mm", 2, 0.05))
    term = fit(Model(problem.file) + KNOWN["backlash"](), problem, noise=NOISE).model.terms[0]
    makes = at_tool_um(term, problem)
    assert 10.0 < makes < 50.0
    assert "at the tool" not in explain_step(term, (), (), (62.0, 9.0), NOISE, problem)
    told = explain_step(term, (), (), (40.0, 9.0), NOISE, problem)
    assert f"; the effect amounts to {makes:.0f} um rms at the tool." in told
    part, most = (explain_step(term, (), (), (makes / far, 0.0), NOISE, problem) for far in (2.0, 9.0))
    assert "um rms at the tool, partly cancelled by the other effects" in part
    assert "um rms at the tool, mostly cancelled by the other effects" in most


def test_what_changes_readings_alone_is_not_said_of_the_tool(tmp_path):
    problem = hide(tmp_path, {"tracker": {"scale_ppm": 300.0}})
    term = fit(Model(problem.file) + KNOWN["tracker-scale"](), problem, noise=NOISE).model.terms[0]
    told = explain_step(term, (), (), (4.0, 0.5), NOISE, problem)
    assert "um rms in the readings" in told and "at the tool" not in told


def test_an_error_that_rises_or_stays_is_not_said_to_fall(tmp_path):
    problem = hide(tmp_path, fault("drive", "backlash_mm", 2, 0.05))
    term = fit(Model(problem.file) + KNOWN["backlash"](), problem, noise=NOISE).model.terms[0]
    rises, stays = (explain_step(term, (), (), errors, NOISE, problem) for errors in ((62.0, 63.0), (61.96, 62.04)))
    assert "rises from 62.0 to 63.0 um" in rises and "stays at 62.0 um" in stays
    assert "Nothing else explains it" not in rises + stays


def test_an_exact_ambiguity_is_not_called_unrivalled(tmp_path):
    problem = hide(tmp_path, fault("drive", "homing_mm", 2, -0.25))
    term = fit(Model(problem.file) + KNOWN["homing-offset"](), problem, noise=NOISE).model.terms[0]
    words = explain_step(term, (), (), (62.0, 9.0), NOISE, problem)
    assert "cannot be told from the tracker's z" in words and "Nothing else" not in words


@pytest.mark.parametrize("steps", [0, 1, 2, 3, 9])
@pytest.mark.parametrize("depends", [0, 1, 7])
def test_an_unknown_takes_five_lines_at_the_most(steps, depends):
    words = explain_verdict(diagnosis("unknown", steps=steps, depends=depends)).splitlines()
    assert len(words) <= 5 and len(set(words)) == len(words)
    assert words[0].startswith("Something is missing that no known effect describes")
    assert any("depends on b2" in line for line in words) == (depends > 0)
    assert (f"effect-{steps - 1}" in " ".join(words) or f"Words of {steps - 1}." in " ".join(words)) or steps == 0


def test_what_the_readings_ask_for_beside_an_unknown_is_said_not_to_be_named():
    words = explain_verdict(diagnosis("unknown", depends=1, steps=1, perhaps=("dh-offsets",))).splitlines()
    assert "The readings also suggest dh-offsets, which" in words[-1] and "is therefore not named" in words[-1]
    assert "also suggest" not in explain_verdict(diagnosis("unknown", depends=1, steps=1))


def test_a_verdict_that_tests_of_the_rest_gave_says_which():
    words = explain_verdict(diagnosis("unknown", depends=1, probability=0.5))
    assert words.startswith("Something is missing that no known effect describes: the readings scatter.")
    assert "the readings scatter" not in explain_verdict(diagnosis("unknown", depends=1))


def test_a_law_that_follows_what_the_unknown_follows_may_be_bent():
    soft, zero = (SimpleNamespace(effect=KNOWN[name]()) for name in ("axis-compliance", "homing-offset"))
    words = explain_verdict(diagnosis("unknown", depends=1, terms=(soft, zero), on="payload"))
    assert (
        "As axis-compliance also depends on payload, this may be a nonlinearity of it rather than another cause"
        in words
    )
    assert "nonlinear" not in explain_verdict(diagnosis("unknown", depends=1, terms=(soft, zero), on="temperature"))
    assert "nonlinear" not in explain_verdict(diagnosis("unknown", depends=1, terms=(zero,), on="payload"))


def test_a_jump_is_said_by_its_place_and_a_slow_rest_by_its_wander():
    """A range 'between 16 and 16' tells nobody anything; that noise is understated is no news where it wanders."""
    jump = explain_verdict(diagnosis("unknown", depends=1, period_mm=None, shape="step", place=(15.98, 16.02)))
    assert "The remaining error of slider 2 jumps where b2 passes 16.00 mm (40 % of its variance). It is large." in jump
    bump = explain_verdict(diagnosis("unknown", depends=1, period_mm=None, shape="local", place=(41.0, 62.0)))
    assert "depends on b2 near 52 mm (40 %" in bump
    floor = NOISE.total * 1e3
    for span, unit, lasts in ((900.0, "s", "about 320 s"), (40.0, "readings", "longer than the run, as a drift does")):
        wander, r = Slow(Wander(4.0, 317.0), span, unit), 317.0 / span
        within = 2.0 * np.sqrt(1.0 - 2.0 * r + 2.0 * r**2 * (1.0 - np.exp(-1.0 / r)))  # about its mean in the run
        slow = explain_verdict(diagnosis("nothing-missing", after=3.0 * floor, wander=wander))
        assert f"the readings wander by {within * floor:.1f} um over {lasts}." in slow and "too small" not in slow
    assert wander.to_dict() == {"share": 4.0, "constant_s": None, "constant_rows": 317.0}
    assert "either that figure is too small" in explain_verdict(diagnosis("nothing-missing", after=3.0 * floor))


def test_a_noise_that_only_the_rest_tells_is_said_to_hide_what_is_rough():
    told = diagnosis("nothing-missing")
    told.noise = replace(NOISE, source="saturated model")
    assert "would be counted as noise; repeated poses" in explain_verdict(told)
    assert "counted as noise" not in explain_verdict(diagnosis("nothing-missing"))


def test_other_verdicts_say_what_they_have_and_how_well():
    words = explain_verdict(diagnosis("missing", steps=2))
    assert words.startswith("Words of 0.\nWords of 1.\nWith these effects the error is 0.3 um, down from 90.0 um")
    late = explain_verdict(diagnosis("missing", steps=1, ties=("other",)))
    assert "Words of 0." in late
    assert explain_verdict(diagnosis("nothing-missing")).startswith("Nothing is missing that these 110 readings")


def test_repeats_that_scatter_by_far_more_than_is_stated_are_said_to():
    told = diagnosis("nothing-missing")
    told.noise = replace(NOISE, source="repeats", stated=("std columns", NOISE.total / 2.5))
    words = explain_verdict(told)
    assert (
        "(from repeats, 2.5 times the value in the std columns). Either poses repeat no better than that, or" in words
    )
    told.noise = replace(told.noise, stated=("machine file", NOISE.total / 1.2))
    assert "times" not in explain_verdict(told)


def test_names_that_an_unknown_may_do_as_well_are_said_to_be_that():
    sure, open_ = (explain_verdict(diagnosis("missing", steps=2, probability=chance)) for chance in (0.95, 0.6))
    assert "probability" not in sure
    assert open_.splitlines() == [
        "There is a 40% probability that part of this is something that no known effect describes.", *sure.splitlines()
    ]  # fmt: skip


def test_what_is_likely_and_small_is_said_beside_what_is_named() -> None:
    words = explain_verdict(diagnosis("missing", steps=1, perhaps=("link-length",)))
    assert words.endswith("Likely as well, but worth too little to be named: link-length.")


def test_an_unknown_that_follows_no_variable_says_so_before_the_little_that_it_follows():
    words = explain_verdict(diagnosis("unknown", depends=1, share=0.004, after=90.0))
    first, rest = words.split("\n")[1].split(". ", 1)
    assert (
        first.startswith("Most of the remaining error follows none of this run's variables") and "depends on b2" in rest
    )
    assert "follows none" not in explain_verdict(diagnosis("unknown", depends=1, share=0.4, after=90.0))


def test_a_small_share_of_what_noise_leaves_is_the_unknown_and_no_small_part_of_it():
    """Of thousands of readings half a micrometre is sure, and 3 % of what is left, of which noise is the rest."""
    assert "follows none" not in explain_verdict(diagnosis("unknown", depends=1, share=0.03))


def test_an_effect_that_would_have_to_be_larger_than_any_is_said_as_a_question():
    words = explain_verdict(diagnosis("unknown", depends=1, perhaps=("screw-growth",), oversized=("screw-growth",)))
    assert "could be screw-growth, at a size that its cause has never been seen to reach" in words
    assert "also suggest" not in words


def test_a_field_is_said_by_all_of_its_variables_and_the_share_of_the_one_that_leads():
    together = {"residual": "z", "on": "y", "share": 0.8, "period_mm": None, "acts_on": None}
    field = {**together, "together": ("x", "y", "z"), "alone_share": 0.06}
    words = explain_verdict(diagnosis("unknown", depends=1, **field))
    assert "error in z depends on x, y and z together (80 % of its variance, y alone 6 %)" in words
    assert "error in z depends on y (80 % of its variance)" in explain_verdict(
        diagnosis("unknown", depends=1, **together)
    )


def test_an_axis_that_hardly_errs_is_not_what_most_of_the_error_follows():
    """A law of z over x and y tilts the fitted frame: y, which errs by 1 um of 50, then follows z."""
    for axis, none in (("y", True), ("z", False)):
        told = diagnosis("unknown", depends=1, after=50.0, residual=axis, on="x", share=0.98, acts_on=None)
        told.rms_um["after"] |= {"x": 4.0, "y": 1.0, "z": 49.8}
        assert ("follows none of this run's variables" in explain_verdict(told)) == none
