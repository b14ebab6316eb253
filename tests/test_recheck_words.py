"""A recheck in words: what a change says of a wave, a curve, a side and a repair."""

import re
from dataclasses import replace

import pytest
import torch
from test_recheck import DATE, run_of

from ptt.again.figures import Moved
from ptt.again.words import say_change, say_whole, values_of
from ptt.effects import library
from ptt.effects.layout import flatten
from ptt.model.model import Term


def moved(name: str, before: float, now: float) -> Moved:
    return Moved("effect", name, 1, f"{name} 1", "mm", before, now, 1e-4)


def test_cosine_and_sine_of_a_wave_are_one_sentence_with_its_height_and_phase() -> None:
    """Each by itself has neither: its height is not the wave's, and without the turn's length no phase is any."""
    view = run_of(2, 20).view
    theta = torch.tensor([0.012, 0.0, 0.0, 0.009, 0.003, 0.0, 5.0], dtype=torch.float64)
    changes = [(0, moved("cosine_mm", 0.012, 0.004)), (3, moved("sine_mm", 0.009, 0.003))]
    values = values_of(Term(library()["once-per-rev"](), theta), changes)
    said = {say_change(values.effect, values.told(at, view), one, view, DATE, repaired=False) for at, one in changes}
    assert said == {
        "Slider 1 repeats an error of 5.0 um with every turn of the screw, highest 0.51 mm in, 10 um less than on 15 "
        "March 2026."
    }
    assert "slider 1 repeats an error of 15 um with every turn of the screw, highest 0.51 mm in" in say_whole(
        values, [one for _, one in changes], view, DATE, repaired=False
    )


def test_a_value_that_chance_had_below_zero_was_no_fault_of_the_other_side() -> None:
    view, then = run_of(2, 20).view, torch.tensor([0.0, -0.00018, 0.0, 1.0], dtype=torch.float64)
    for error, words in ((5e-4, "but not in the model of 15 March 2026"), (5e-5, "compensates 0.18 um too much")):
        one = replace(moved("gap_mm 2", -0.00018, 0.05), std=error)
        values = values_of(Term(library()["backlash"](), then), [(1, one)])
        assert words in say_change(values.effect, values.told(1, view), one, view, DATE, repaired=False)


@pytest.mark.parametrize("repaired", [False, True])
def test_an_effect_is_said_to_be_repaired_as_a_whole_by_the_same_rule_as_its_rows(repaired: bool) -> None:
    """A tenth of what it was says so alone; that it was never clear, and is no repair then, the rows know."""
    view = run_of(2, 20).view
    theta = torch.tensor([0.012, 0.0, 0.0, 0.009, 0.003, 0.0, 5.0], dtype=torch.float64)
    changes = [moved("cosine_mm", 0.012, 0.0012), moved("sine_mm", 0.009, 0.0009)]
    values = values_of(Term(library()["once-per-rev"](), theta), [(0, changes[0]), (3, changes[1])])
    assert say_whole(values, changes, view, DATE, repaired=repaired).startswith("Repaired: ") == repaired


def test_a_curve_that_has_changed_is_said_where_it_is_highest_of_all_its_bends() -> None:
    view, effect = run_of(2, 20).view, library()["screw-error-map"]()
    shape = effect.search(view)[0]
    theta = flatten(effect, shape, 3)
    theta[0], theta[1] = 0.03, 0.01
    values = values_of(Term(effect, theta), [(0, moved("curve_mm 1.1", 0.03, 0.06))])
    words = say_change(effect, values.told(0, view), moved("curve_mm 1.1", 0.03, 0.06), view, DATE, repaired=False)
    low, high = (float(shape[end][0]) for end in ("from", "to"))
    places = [float(one) for one in re.findall(r"near b = (-?\d+) mm", words)]
    assert "Slider 1 runs up to" in words and places and all(low < place < high for place in places), words
