"""Stated errors against the truth, on rigs that share no equation with the effects: single, several, other geometry."""

import numpy as np
import pulls
import pytest

SEEDS = {"single": range(200, 214), "several": range(200, 208), "foreign": range(200, 210)}


@pytest.fixture(scope="module")
def found() -> list:
    return [pull for family, seeds in SEEDS.items() for seed in seeds for pull in pulls.pulls_of(family, seed)]


def test_parameters_lie_where_their_standard_errors_say(found: list) -> None:
    size = np.abs([pull.value for pull in found if pulls.plain(pull)])
    assert len(size) > 60
    assert np.mean(size <= 2.0) >= 0.88 and size.max() < 5.0
    assert 0.55 <= np.mean(size <= 1.0) <= 0.85  # neither too narrow nor too wide


def test_laws_that_are_richer_in_the_rig_stay_near(found: list) -> None:
    size = np.abs([pull.value for pull in found])
    assert len(size) > 150 and np.mean(size <= 3.0) >= 0.95
