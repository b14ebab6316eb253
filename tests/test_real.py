"""Real measurements with published results: the ladder of a humanoid's arms, the terms of a telescope's mount."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import real
import real_data
import real_published

from ptt.diagnosis.diagnose import diagnose
from ptt.fitting.solve import fit
from ptt.model.model import Model


def needs(folder: str) -> None:
    if not real_data.here(folder):
        pytest.skip(f"the readings lie beside the project, in shared/data/{folder}")


def test_humanoid_repeats_the_published_ladder() -> None:
    """Within a fifth: how the shoulders sit is not published, and both hands share no frame here."""
    needs("dlr_justin")
    steps = ((), ("homing-offset",), ("dh-offsets",), ("dh-offsets", "self-weight"))
    means = []
    for side in real_published.SIDES:
        problem = real_data.open_set(*real_data.humanoid(side))
        means.append(
            [
                real_published.mean_mm(fit(real_published.with_effects(problem, names), problem), problem)
                for names in steps
            ]
        )
    found = np.mean(means, axis=0)
    published = np.array([21.33, 18.18, 10.5, 5.64])
    assert (np.abs(found / published - 1.0) < 0.2).all(), found
    assert (np.diff(means, axis=1) < 0.0).all(), means


def test_the_other_arms_weight_is_what_one_chain_misses() -> None:
    """A user's own effect beside self-weight: rows that no parameter saw get better by a quarter at least."""
    needs("dlr_justin")
    problem = real_data.open_set(*real_data.humanoid("right"))
    shown, hidden = real.halves(problem)
    alone = real_published.with_effects(problem, ("dh-offsets", "self-weight"))
    errors = [
        np.linalg.norm(fit(model, problem.masked(~shown)).residual[hidden], axis=1).mean()
        for model in (
            real_published.with_effects(problem, ("dh-offsets",)),
            alone,
            alone + real_data.other_arm("right"),
        )
    ]
    assert errors[1] < 0.9 * errors[0] and errors[2] < 0.75 * errors[1], errors


def test_telescope_has_its_published_terms() -> None:
    needs("rts2_pointing")
    for row in real_published.telescope_terms():
        published, error = row["published"]
        assert abs(row["arcsec"] - published) < error, row


def test_telescope_moves_through_its_second_night() -> None:
    """By some ten arc seconds in five hours, more than a star scatters; no published term has time in it."""
    needs("rts2_pointing")
    second = [row["arcsec"] for row in real_published.telescope_drift() if row["night"] == 2]
    for way in range(2):
        (first, error), (last, other) = second[0][way], second[-1][way]
        assert last - first > 4.0 * np.hypot(error, other), second


def test_telescope_points_where_its_errors_say() -> None:
    """By the file's own error columns, to first order: along the circle of altitude, and across it."""
    needs("rts2_pointing")
    problem = real_data.open_set(*real_data.telescope())
    q, p = problem.view.q.numpy(), problem.table.measured / real_data.STAR_MM
    drawn = problem.view.mechanism.forward(problem.view.q).numpy() / real_data.STAR_MM
    q = q[:, 1:]
    upward = np.column_stack([-np.sin(q[:, 1]) * np.cos(q[:, 0]), -np.sin(q[:, 1]) * np.sin(q[:, 0]), np.cos(q[:, 1])])
    east = np.column_stack([np.sin(q[:, 0]), -np.cos(q[:, 0]), np.zeros(len(q))])
    found = np.column_stack([((drawn - p) * way).sum(axis=1) for way in (upward, east)])
    rows = pd.read_csv(real_data.DATA / "rts2_pointing" / "altaz.csv")
    said = np.radians(np.column_stack([rows["az_err_deg"], rows["alt_err_deg"] * np.cos(q[:, 1])]))
    np.testing.assert_allclose(found, said, atol=3e-6)


@pytest.mark.parametrize(
    ("frame", "timed", "sigma"),
    [
        ("trusted", False, 0.037),
        ("fitted", True, None),
        pytest.param("trusted", True, None, marks=pytest.mark.long),
        pytest.param("trusted", True, 0.037, marks=pytest.mark.long),
        pytest.param("trusted", False, None, marks=pytest.mark.long),
        pytest.param("fitted", True, 0.037, marks=pytest.mark.long),
        pytest.param("fitted", False, None, marks=pytest.mark.long),
        pytest.param("fitted", False, 0.037, marks=pytest.mark.long),
    ],
)
def test_telescope_of_two_axes_is_named_alike_in_every_set_up(frame: str, timed: bool, sigma: float | None) -> None:
    """What its drift, its lean and errors of one part of the sky ask for beside it does not hide what does most.

    Without times the drift looks like three slips: stages of one change, and none of them is named.
    """
    needs("rts2_pointing")
    file, table = real_data.plain_telescope(frame, timed)
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": sigma}))
    problem = real_data.open_set(file, table)
    found = diagnose(Model(problem.file), problem)
    assert found.suggested == (("dh-offsets",),), found.words


@pytest.mark.parametrize(
    ("name", "count", "worst"), [("B", 50, 1.25), ("D", 50, 1.25), ("B", 100, 1.0), ("D", 100, 1.0)]
)
def test_link_geometry_fitted_on_few_rows_predicts_the_others(name: str, count: int, worst: float) -> None:
    """A stretch of a UR10's run sees few of its 30 link parameters: the error of all other rows is still the smaller.

    Of 50 rows, many of them repeats of a pose, one stretch in eight makes it a little larger.
    """
    needs("ur10_ipa")
    problem = real_data.open_set(*real_data.ur10(name))
    ratio = np.divide(*np.transpose([real.unseen(problem, count, seed)[::-1] for seed in range(4)]))
    assert np.median(ratio) < 0.85 and ratio.max() < worst, ratio
