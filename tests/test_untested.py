"""An unknown may be a known effect that the run cannot test: the words say which, and what it needs."""

from types import SimpleNamespace

import numpy as np
import pytest

from ptt.dependence.dependence import Dependence
from ptt.diagnosis.telling.untested import untested

LACKS = {
    "screw-growth": "column temp_c", "frame-growth": "column temp_c", "joint-error-map": "at least 600 rows",
    "axis-compliance": "a payload", "my-own": "nothing",
}  # fmt: skip


@pytest.mark.parametrize(
    ("on", "acts_on", "told"),
    [
        ("time", "slider 3", "It may be screw-growth; to test that, `ptt diagnose` needs column temp_c."),
        ("time", "link 1", "It may be frame-growth; "),
        ("time", None, "It may be screw-growth or frame-growth; "),
        ("q2", "joint 2", "It may be joint-error-map; to test that, `ptt diagnose` needs at least 600 rows."),
        ("q4", "joint 1", ""),
        ("payload", "slider 1", "It may be axis-compliance; "),
        ("direction1", "slider 1", ""),
        ("x", None, ""),
    ],
)
def test_what_follows_the_variable_of_an_untestable_effect_may_be_it(on: str, acts_on: str | None, told: str) -> None:
    found = Dependence("z", on, 0.9, 1e-9, None, "smooth", np.zeros((2, 3)), acts_on=acts_on)
    words = untested(SimpleNamespace(not_testable=LACKS), found)
    assert words.strip().startswith(told) and bool(words) == bool(told)


def test_what_switches_is_no_known_effect() -> None:
    found = Dependence("z", "time", 0.9, 1e-9, None, "levels", np.zeros((2, 3)), moments=(3.0, 5.0))
    assert not untested(SimpleNamespace(not_testable=LACKS), found)
    jumped = Dependence("z", "time", 0.9, 1e-9, None, "step", np.zeros((2, 3)), place=(3.0, 4.0))
    assert not untested(SimpleNamespace(not_testable=LACKS), jumped)
