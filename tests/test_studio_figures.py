"""Figures of the studio: valid, with their units, thinned where a run is long."""

import json
import re
from dataclasses import replace
from importlib.resources import files

import numpy as np
import plotly.graph_objects as go
from studio_sample import added as added
from studio_sample import folder as folder
from studio_sample import fresh
from studio_sample import look as look

from ptt.show.card.solids import arrows
from ptt.show.studio import arrow_figure, figures, ladder_figures, machine_figure
from ptt.show.studio.looks import Look
from ptt.show.studio.results import Changed
from ptt.show.studio.snapshot import Rung


def test_figures_are_valid_plotly_and_say_their_units(look: Look, added: Changed):
    picked = look.visits_of(5).tolist()
    rungs = fresh().changed("add", ("backlash",), added).now.rungs  # type: ignore[union-attr]
    drawn = [
        machine_figure.machine_figure(look, 5, picked=picked, scale=200.0),
        machine_figure.machine_figure(look, 0, scale=200.0, machine=False, near=True),
        *(figures.against_figure(look, view, "direction1", picked, ("other", look)) for view in look.views),
        *(figures.against_figure(look, "x", context) for context in look.contexts),
        ladder_figures.ladder_figure(rungs, added.data["noise_um"], "y"),
        ladder_figures.ladder_figure(rungs[:1], added.data["noise_um"]),
    ]
    for figure in drawn:
        checked = go.Figure(data=figure["data"], layout=figure["layout"])  # refuses what plotly does not know
        assert "[" in str(checked.layout) and json.dumps(checked.to_plotly_json(), default=list)
    traces = drawn[0]["data"]
    assert {"rails", "sliders", "links", "platform", "errors", "readings", "picked"} == {t["name"] for t in traces}
    assert next(t for t in traces if t["name"] == "picked")["customdata"] == picked
    colours = next(t for t in traces if t["name"] == "errors")
    assert colours["cmin"] == 0.0 and colours["colorscale"] == "Cividis"


def test_a_ladder_over_an_axis_that_never_errs_has_a_finite_scale(added: Changed):
    nothing = dict.fromkeys(("x", "y", "z", "total"), 0.0)
    rungs = (Rung("as given", nothing, nothing), Rung("+ backlash", nothing, nothing))
    low, high = ladder_figures.ladder_figure(rungs, added.data["noise_um"], "z")["layout"]["yaxis"]["range"]
    assert np.isfinite([low, high]).all() and low < np.log10(added.data["noise_um"]["z"]) < high


def test_colours_of_curves_stand_out_on_light_and_dark_cards():
    """The contrast of WCAG for what is drawn, 3 to 1 with rounding; the pale ones lie behind others on purpose."""
    style = files("ptt.show.studio").joinpath("style.css").read_text(encoding="utf-8")
    cards = re.findall(r"--card:(#[0-9a-f]+)", style)

    def light(colour: str) -> float:
        whole = colour if len(colour) == 7 else "#" + "".join(2 * digit for digit in colour[1:])
        parts = np.asarray([int(whole[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
        return float(
            np.where(parts <= 0.03928, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4) @ (0.2126, 0.7152, 0.0722)
        )

    assert len(cards) == 2
    for colour in (figures.BLUE, figures.VIOLET, figures.ORANGE, figures.GREY):
        for card in cards:
            low, high = sorted((light(colour), light(card)))
            assert (high + 0.05) / (low + 0.05) > 2.95, (colour, card)


def test_arrows_are_means_of_poses_and_as_long_as_stated(look: Look):
    means = arrow_figure.mean_arrows(look)
    place, mean, count = means.place, means.error, means.count
    assert count.sum() == look.kept.sum() and len(place) < look.rows
    solid, owner = arrows(place, 250.0 * mean, 1.0)
    for number in (0, len(place) // 2, len(place) - 1):
        rows = look.kept & (np.linalg.norm(look.target - place[number], axis=1) < 1e-2)
        assert rows.sum() == count[number]
        np.testing.assert_allclose(mean[number], look.residual[rows].mean(axis=0), atol=1e-12)
        tip = place[number] + 250.0 * look.residual[rows].mean(axis=0)
        assert np.linalg.norm(solid.points[owner == number] - tip, axis=1).min() < 1e-9


def test_a_large_run_is_thinned_but_what_is_picked_is_drawn(look: Look):
    many = np.tile(np.arange(look.rows), 30)
    spread = look.target[many] + np.random.default_rng(0).normal(size=(len(many), 3))
    large = replace(look, line=np.arange(len(many)), target=spread, residual=look.residual[many], kept=look.kept[many])
    rows = figures.shown_rows(large, [3, 1001])
    assert figures.MOST_READINGS <= len(rows) <= figures.MOST_READINGS + 2 and {3, 1001} <= set(rows.tolist())
    means = arrow_figure.mean_arrows(large)
    assert len(means.place) <= arrow_figure.SHOWN_ARROWS and means.count.sum() == large.kept.sum()
    whole = (means.count[:, None] * means.error).sum(axis=0)  # every reading is in one mean, and once
    np.testing.assert_allclose(whole, large.residual[large.kept].sum(axis=0), atol=1e-9)
    apart = np.linalg.norm(large.target[means.row] - means.place, axis=1)
    assert (
        large.kept[means.row].all() and apart.max() < np.ptp(large.target, axis=0).max() / 4.0
    )  # a reading of its own
    assert arrow_figure.mean_arrows(large) is means
