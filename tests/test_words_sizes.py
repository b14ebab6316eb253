"""Sizes in words: prefixes, digits and lists, for any size of any effect."""

import re

import pytest
import torch
from test_effects_words import KNOWN, hide

from ptt.effects.layout import family
from ptt.effects.phrases import compose, figure, listed, scaled


@pytest.mark.parametrize(
    ("value", "text"),
    [(250.4, "250"), (41.3, "41"), (9.96, "10.0"), (5.04, "5.0"), (0.2, "0.20"), (0.0341, "0.034"), (100.0, "100")],
)
def test_figures_have_two_digits_that_count(value, text):
    assert figure(value) == text


@pytest.fixture(scope="module")
def no_fault(tmp_path_factory):
    return hide(tmp_path_factory.mktemp("no_fault"), {})


NUMBER = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?)(?= (?:n|u|m)?(?:m|rad|s)\b|[,\d. ]* and)")


@pytest.mark.parametrize("name", [name for name, effect in KNOWN.items() if "three-ptt" in effect.mechanisms])
@pytest.mark.parametrize("times", [2e-3, 1.0, 50.0, 3000.0])
def test_any_size_of_any_effect_is_said_with_a_prefix_and_its_side(no_fault, name, times):
    """Small, usual and off the scale: no row of noughts, no powers of ten, and the other sign in other words."""
    effect, view = KNOWN[name](), no_fault.view
    usual = [p.usual for p in (q.on(family(view)) for q in effect.parameters) for _ in range(p.size(view.joints))]
    theta = times * torch.tensor(usual, dtype=torch.float64)
    plus, minus = (compose(effect.say(s * theta, 0.01 * theta, view), effect.noun) for s in (1.0, -1.0))
    assert plus != minus and not re.search(r"\de[+-]\d|-0 ", plus + minus)
    sizes = [float(found) for found in NUMBER.findall(plus.split(" near ")[0].split(", highest")[0])]
    assert 0.01 <= max(sizes) < 10_000.0, plus


def test_the_prefix_is_that_of_all_sizes_together():
    assert scaled([25_000.0, 10_000.0], "um") == (1e-3, "mm") and scaled([999.0, 2000.0], "um") == (1.0, "um")
    assert scaled([4e-4, 1e-4], "\N{MICRO SIGN}m/N") == (1e3, "nm/N") and scaled([60_000.0], "ms") == (1e-3, "s")
    assert scaled([3e6], "urad") == (1e-6, "rad") and scaled([5e9], "kg") == (1.0, "kg") and scaled([], "um")[1] == "um"


def test_a_list_of_nothing_is_no_error() -> None:
    lists = [listed(["a", "b", "c"][:count]) for count in range(4)]
    assert lists == ["", "a", "a and b", "a, b and c"]
