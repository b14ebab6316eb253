"""Stated errors against the truth, on rigs that share no equation with the effects: single, several, other geometry."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"


def load_pulls() -> ModuleType:
    sys.path.insert(0, str(BENCHMARKS))
    spec = importlib.util.spec_from_file_location("bench_pulls", BENCHMARKS / "pulls.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


pulls = load_pulls()
SEEDS = {"single": range(200, 210), "several": range(200, 206), "foreign": range(200, 210)}


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
