"""Recheck where the first run could not tell all: faults that it put on a neighbour, had too small or never reached."""

from pathlib import Path

import numpy as np
from test_recheck import SIGMA, look, run_of, solve

from ptt.again.explanation import find_explanation
from ptt.again.prior import build_prior
from ptt.effects import library
from ptt.model.of_run import for_runs


def test_what_is_new_at_one_slider_is_told_beside_what_is_gone_at_another(tmp_path: Path) -> None:
    """Its play was never there, so nothing of it was clear in the run of the model.

    That it has come is one change, that all are gone another: where both speak of one value, it stands where both
    together put it.
    """
    before = solve(run_of(1, drive={"backlash_mm": (0.03, 0.0, 0.045)}), ("backlash", "link-length"), tmp_path)
    found = look(before, run_of(4, drive={"backlash_mm": (0.0, 0.08, 0.0)}))
    assert {item.moved.name: item.repaired for item in found.changed} == {
        "gap_mm 1": True,
        "gap_mm 2": False,
        "gap_mm 3": True,
    }
    assert "Slider 2 loses 8" in found.words and "Repaired: backlash as a whole is" in found.words


def test_a_cure_gives_back_what_the_first_fit_had_taken_from_its_neighbour(tmp_path: Path) -> None:
    """Twist and leaning towers share an error that one run cannot part: half of each went to the other."""
    sound = {"backlash_mm": (0.0, 0.0, 0.0)}
    lean = {"link_mm": (0.0,) * 3, "lean_radial_mrad": (0.0, 0.62, 0.0), "lean_tangential_mrad": (0.0, 0.75, 0.0)}
    twist = {"platform_axis_radial_mrad": (-0.12, -0.54, -0.12), "platform_axis_vertical_mrad": (-0.56, 0.3, 0.58)}
    first = solve(run_of(1, 50, drive=sound, geometry=lean | twist), ("platform-twist", "tower-tilt"), tmp_path)
    tilt = next(term for term in first.model.terms if term.effect.key == "tower-tilt")
    assert tilt.std is not None and abs(float(tilt.theta[4]) - 0.75e-3) < 2.0 * float(tilt.std[4])
    assert max(abs(float(tilt.theta[place])) for place in (3, 5)) > 2e-4  # towers that stand upright
    found = look(first, run_of(11, 60, drive=sound, geometry=lean))
    assert found.verdict == "changed" and {item.moved.effect for item in found.changed} == {"platform-twist"}
    assert all(item.repaired for item in found.changed)
    assert found.made_um["now"]["platform-twist"] < 0.05 * found.made_um["before"]["platform-twist"]
    assert found.error_um["left"] < 1.2 * np.sqrt(3.0) * 1e3 * SIGMA < 0.5 * found.error_um["now"]
    now = next(term for term in found.model.terms if term.effect.key == "platform-twist")
    assert not now.theta.any()


def test_what_the_first_run_had_hidden_in_another_effect_is_no_change_and_nothing_new(tmp_path: Path) -> None:
    """A lead error in a small volume passes for misplaced towers; in a large one it shows, and nothing has happened."""
    lead = {
        "drive": {"backlash_mm": (0.0,) * 3, "scale_um_per_m": (300.0, -200.0, 0.0)},
        "geometry": {"link_mm": (0.0,) * 3},
    }
    small, large = (25.0, 25.0, 15.0), (60.0, 60.0, 50.0)
    first = solve(run_of(1, 40, room=small, **lead), ("tower-position",), tmp_path)
    assert first.model.file.history[-1]["heldout_after_um"]["total"] < 1.3 * np.sqrt(3.0) * 1e3 * SIGMA
    found = look(first, run_of(12, 70, room=large, **lead))
    assert found.verdict == "same" and not found.changed
    assert found.error_um["left"] < 1.2 * np.sqrt(3.0) * 1e3 * SIGMA < 0.6 * found.error_um["now"]
    assert any("lead-scale is not in the model" in note for note in found.notes)
    missed = {**lead, "drive": {**lead["drive"], "turn_um": (0.0, 0.0, 12.0)}}
    model, _ = for_runs(first.model, again := run_of(12, 70, room=large, **missed))
    explained = find_explanation(build_prior(model, again), again, library(), str)
    assert {room.effect.key for room in explained.masked} == {"lead-scale"}
    assert [key.partition("#")[0] for key in explained.new] == ["once-per-rev"]


def test_beyond_the_heights_of_the_first_run_a_curve_may_go_on_as_it_likes(tmp_path: Path) -> None:
    screw = {"backlash_mm": (0.0, 0.0, 0.0), "curve_parabola_um": (0.0, -25.0, 35.0),
             "curve_cubic_um": (15.0, 20.0, -25.0), "curve_span_mm": (180.0, 400.0)}  # fmt: skip
    links = {"link_mm": (0.0, 0.0, 0.0)}
    first = solve(run_of(1, room=(30.0, 30.0, 20.0), drive=screw, geometry=links), ("screw-error-map",), tmp_path)
    found = look(first, run_of(11, room=(60.0, 60.0, 50.0), drive=screw, geometry=links))
    assert found.verdict == "same" and not found.changed
    assert found.error_um["now"] > 1.5 * 1e3 * SIGMA * np.sqrt(3.0)  # and yet nothing has happened
    assert (
        max(abs(one.now - one.before) for one in found.parameters) < 0.2
    )  # bends that no row tells stay where they were
    assert any("when the model was made" in note and "screw-error-map" in note for note in found.notes)
    turning = run_of(11, 60, room=(60.0, 60.0, 50.0), drive={**screw, "turn_um": (0.0, 0.0, 25.0)}, geometry=links)
    model, _ = for_runs(first.model, turning)
    new = find_explanation(build_prior(model, turning), turning, library(), str).new
    assert [key.partition("#")[0] for key in new] == ["once-per-rev"]
