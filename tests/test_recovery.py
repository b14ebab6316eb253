"""Recovery on the virtual machine and on real printers: a smaller draw of what the benchmarks print."""

import coverage
import klipper
import numpy as np
import pytest

DRAWS = 3


@pytest.fixture(scope="module")
def scores(tmp_path_factory: pytest.TempPathFactory) -> dict:
    return coverage.cover(list(coverage.TRUTH), DRAWS, tmp_path_factory.mktemp("runs"))


@pytest.mark.parametrize("name", sorted(coverage.TRUTH))
def test_truth_lies_within_three_standard_errors(scores: dict, name: str) -> None:
    distances = np.abs(np.concatenate([item.distances for item in scores[name]]))
    assert np.mean(distances <= 3.0) >= 0.9, distances
    assert distances.max() < 6.0


def test_one_standard_error_is_neither_too_wide_nor_too_narrow(scores: dict) -> None:
    """Each effect counts once: a map's many small values, which their prior mostly holds, would outvote all others."""
    shares = [np.mean(np.abs(np.concatenate([item.distances for item in each])) <= 1.0) for each in scores.values()]
    assert 0.60 <= np.mean(shares) <= 0.77


def test_gauges_are_told_every_time(scores: dict) -> None:
    assert all(item.told == item.unseen for each in scores.values() for item in each)
    assert any(item.unseen for item in scores["homing-offset"])


def test_real_printers_drift_less_than_their_firmware_says() -> None:
    if not klipper.DATA.exists():
        pytest.skip("the printers' probes lie beside the project, in shared/data/klipper_delta")
    cases = klipper.load()
    fits = [klipper.fit_heights(case, np.ones(len(case.height), dtype=bool)) for case in cases]
    mine = [float(np.sqrt(np.mean(left**2))) for _, _, left in fits]
    theirs = [float(np.sqrt(np.mean(case.saved**2))) for case in cases]
    assert np.median(np.array(mine) / np.array(theirs)) < 1.0
    same = [i for i, case in enumerate(cases) if case.printer.startswith("fzechert")]
    arms = np.array([fits[i][0][9:] for i in same]).std(axis=0, ddof=1)
    saved = np.array([cases[i].saved_geometry[:3] for i in same]).std(axis=0, ddof=1)
    assert len(same) == 4 and (arms < 0.2 * saved).all()
