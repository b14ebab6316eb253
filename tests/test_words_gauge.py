"""What can be turned, and what it cannot be told from."""

import re
from dataclasses import replace

import numpy as np
import pytest
import torch
from test_effects_words import KNOWN, NOISE, SIGMA, N, fault, hide, say, sized
from typer.testing import CliRunner

from ptt.challenge.challenge import bench as bench_machine
from ptt.commands.main import app
from ptt.diagnosis.telling.words import sentences
from ptt.fitting import gauge
from ptt.fitting.gauge import sparsest
from ptt.fitting.solve import fit, residual_of
from ptt.machine import format_machine
from ptt.model.model import Model, Term
from ptt.run.noise import Noise

MACHINE = bench_machine()


def test_one_slider_is_one_slider_whatever_the_frame(tmp_path):
    faults = fault("drive", "homing_mm", 2, -0.25)
    (fitted,) = say(hide(tmp_path, faults), "homing-offset")
    assert re.match(
        r"Slider 2 stands 250 um lower than b says: homing \(sliders against each other; .*tracker's z\)", fitted
    )
    (trusted,) = say(hide(tmp_path, faults, frame="trusted"), "homing-offset")
    mended = "To set right: raise slider 2 by 250 um (18 deg of its screw)."
    assert trusted == f"Slider 2 stands 250 um lower than b says: homing. {mended}"
    assert fitted.endswith(mended)


@pytest.mark.parametrize(("section", "key", "name"), [
    ("drive", "homing_mm", "homing-offset"), ("geometry", "link_mm", "link-length"),
    ("geometry", "tower_radial_mm", "tower-position"), ("geometry", "tower_tangential_mm", "tower-position"),
    ("geometry", "lean_radial_mrad", "tower-tilt"), ("geometry", "lean_tangential_mrad", "tower-tilt"),
])  # fmt: skip
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_turned_as_told_is_right(tmp_path, section, key, name, sign):
    """The rig is mended by the side and the number that were said, and is then as good as drawn."""
    size = (1.5 if "mrad" in key else 0.3) * sign
    (words,) = say(hide(tmp_path, fault(section, key, 2, size)), name)
    told = re.search(rf"To set right: (.*?) (?:slider|link|tower) 2 ?(.*?) by {N} (um|mrad)", words)
    assert told, words
    less = {
        "lower",
        "shorten",
        "move inward",
        "move clockwise",
        "shim the head of inward",
        "shim the head of clockwise",
    }
    turned = float(told[3]) * (1e-3 if told[4] == "um" else 1.0)
    left = size - turned if f"{told[1]} {told[2]}".strip() in less else size + turned
    assert abs(left) < 0.02 * abs(size)


def test_an_error_in_words_is_no_wider_than_what_all_values_of_the_effect_may_be_off_by(tmp_path):
    """Readings that hardly tell a gauge leave it anything at all; sizes that such machines have hold the values."""
    problem = hide(tmp_path, fault("drive", "homing_mm", 2, -0.25))
    terms = fit(Model(problem.file) + KNOWN["homing-offset"](), problem, noise=NOISE).model.terms
    most = 1e3 * float(terms[0].std.norm())
    (rough,), (blind,) = (sentences(terms, problem, NOISE, widen) for widen in (1e3, 1e5))
    assert sized(rough, rf"give or take {N} um") < 0.5 * most
    assert sized(blind, rf"give or take {N} um") == pytest.approx(most, rel=0.01)


def test_two_towers_are_two_towers(tmp_path):
    faults = {"geometry": {"tower_tangential_mm": [0.2, 0.0, 0.0], "tower_radial_mm": [0.0, -0.3, 0.0]}}
    (words,) = say(hide(tmp_path, faults), "tower-position")
    assert sized(words, rf"tower 1 stands {N} um too far counter-clockwise") == pytest.approx(200.0, rel=0.02)
    assert sized(words, rf"Tower 2 stands {N} um too far inward") == pytest.approx(300.0, rel=0.02)
    assert "tower 3" not in words and "the tracker's x and y and its rotation about z" in words


def test_a_lean_is_not_spread_over_zeros_and_towers(tmp_path):
    problem = hide(tmp_path, fault("geometry", "lean_radial_mrad", 1, 1.5))
    homing, lean = say(problem, "homing-offset", "tower-tilt")
    assert re.search(r"Tower 1 leans outward by 1\.5 mrad: ", lean)
    assert sized(homing, rf"{N} um") < 1.0 and "none of these alone is beyond chance" in homing
    assert "rotation about x and y" in lean


def test_a_gauge_moves_no_reading(tmp_path):
    problem = hide(tmp_path, {"drive": {"homing_mm": [0.1, -0.25, 0.0]}, "geometry": {"tower_radial_mm": [0, 0.2, 0]}})
    model = Model(problem.file) + KNOWN["homing-offset"]() + KNOWN["tower-position"]()
    fitted = fit(model, problem, noise=NOISE)
    told = sparsest(fitted.model.terms, problem, NOISE)
    moved = replace(fitted.model, terms=tuple(one.term for one in told))
    held = residual_of(moved, problem, NOISE)
    assert np.abs(held.residual - fitted.residual).max() < SIGMA
    assert told[0].alike == ("tracker z",)
    assert told[1].alike == ("tracker x", "tracker y", "tracker rotation about z")
    assert sum(float((one.term.theta.abs() > 10.0 * SIGMA).sum()) for one in told) == 3.0


def test_the_error_of_a_value_counts_what_the_readings_have_to_tell_it_from(tmp_path):
    """Of towers that stand off, and may lean as well."""
    problem = hide(tmp_path, fault("geometry", "tower_radial_mm", 2, 0.2))
    model = Model(problem.file) + KNOWN["tower-position"]() + KNOWN["tower-tilt"]()
    place, lean = fit(model, problem, noise=NOISE).model.terms
    (alone,), (beside,) = sparsest([place], problem, NOISE), sparsest([place], problem, NOISE, beside=[lean])
    assert torch.allclose(alone.term.theta, beside.term.theta) and alone.alike == beside.alike
    off = alone.term.std > 0.0
    (loose,) = sparsest([place], problem, NOISE, extra=lambda names: 0.01 * np.eye(len(names)))
    assert (loose.term.std[off] > 5.0 * alone.term.std[off]).all() and (loose.term.std[~off] == 0.0).all()
    assert off.any() and (beside.term.std[off] > 1.2 * alone.term.std[off]).all()


def test_what_cannot_be_told_does_not_hang_on_the_directions_that_stand_for_it(tmp_path, monkeypatch):
    """Where noise hides all of a tower's shifts, those that the tracker makes good for are among them all."""
    problem, small = hide(tmp_path, {}), torch.full((6,), 1e-3, dtype=torch.float64)
    term = Term(KNOWN["tower-position"](), small, std=small)
    mixed, untold = np.linalg.qr(np.random.default_rng(3).normal(size=(6, 6)))[0], gauge._untold
    monkeypatch.setattr(gauge, "_untold", lambda *given: untold(*given) @ mixed)
    (told,) = sparsest([term], problem, Noise(np.eye(3), "wide"))
    assert told.alike == ("tracker x", "tracker y", "tracker rotation about z")


def test_add_prints_what_to_turn_and_no_digit_that_chance_would_make(tmp_path):
    faults = fault("drive", "homing_mm", 2, -0.25) | {"controller": {"backlash_mm": [0.0, 0.0, 0.02]}}
    problem = hide(tmp_path, faults)
    machine = tmp_path / "machine.toml"
    machine.write_text(format_machine(problem.file))
    known = ["add", str(tmp_path / "run.csv"), "homing-offset", "--model", str(machine)]
    outcome = CliRunner().invoke(app, [*known, "--out", str(tmp_path / "m.toml")])
    assert outcome.exit_code == 0, outcome.output
    (homing,) = (line for line in outcome.stdout.splitlines() if ": homing" in line)
    assert re.search(r"To set right: raise slider 2 by 2[45]\d um \(1\d deg of its screw\)", homing)
    assert "slider 1" not in homing  # what 20 um of over-compensation leave is far beyond the tracker's noise
