"""What the studio draws: solids that are closed, ghosts on the part at fault, arms drawn whole, arrows apart."""

from pathlib import Path

import numpy as np
import pytest
from studio_sample import DATA, MACHINE, RUN, silent
from studio_sample import folder as folder
from studio_sample import here as here

from ptt.machine import load_machine
from ptt.rig.draw_arm import draw_arm
from ptt.show.card.ghost import ghosts_of
from ptt.show.card.scene import legs_at_fault, moved, parts_of, usual_times
from ptt.show.card.solids import arrows
from ptt.show.studio import jobs
from ptt.show.studio.card_figures import ruler_words
from ptt.show.studio.machine_figure import ROOM, chain_figure
from ptt.show.studio.opening import open_both
from ptt.show.studio.results import Source


def test_the_card_of_an_arm_shows_the_joint_at_fault_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The virtual arm's play of 362 and 300 urad: two branches half the gap from zero, whatever the lever of a pose."""
    monkeypatch.chdir(tmp_path)
    for name in ("run.csv", "machine.toml"):
        (tmp_path / name).write_bytes((DATA.parent / "arm" / name).read_bytes())
    learned = jobs.diagnose(Source("run.csv"), (tmp_path / "machine.toml").read_text(encoding="utf-8"), silent)
    fit, hidden = learned.fits["backlash"], draw_arm(load_machine("machine.toml").machine, "backlash", 41).rig.faults
    label, name, unit = fit["labels"]
    gaps = [1e6 * gap for gap in hidden.gap.tolist()]
    joint = int(name.split()[1]) - 1
    assert gaps[joint] == max(gaps) and label.startswith(f"angle of joint {joint + 1}") and unit == "urad"
    through = np.asarray(fit["fit_um"])
    for side in (through[through > 0.0], -through[through < 0.0]):
        assert np.median(side) == pytest.approx(0.5 * gaps[joint], rel=0.15)  # the frame takes a part of it
        assert np.quantile(np.abs(side - np.median(side)), 0.9) < 0.25 * np.median(side)
    finding = learned.card["findings"][0]
    assert "screw" not in finding["cause"] and "joint" in finding["cause"]
    middle = ruler_words(finding["values"][0])[2]
    assert middle == "usual 500 \N{MICRO SIGN}rad"


def test_near_arrows_keep_apart_and_lone_ones_are_as_thick_as_they_are_long():
    start, vector = np.arange(5.0)[:, None] * (1.0, 0.0, 0.0), np.tile((0.0, 0.0, 40.0), (5, 1))
    near, owner = arrows(start, vector, 1.0, 0.4)
    wide = [np.ptp(near.points[owner == number][:, 0]) for number in range(5)]
    assert max(wide) < 0.9 and np.ptp(arrows(start[:1], vector[:1], 1.0)[0].points[:, 0]) > 5.0


def test_an_arm_is_drawn_whole(tmp_path: Path):
    """A long thin arm lies within its axes, and its box is no longer for the camera than a cube."""
    drawn = chain_figure([[0.0, 0.0, 0.0], [0.0, 0.0, 127.0], [-1184.0, 0.0, 127.0], [-1184.0, -256.0, 12.0]])
    scene, ratio = drawn["layout"]["scene"], drawn["layout"]["scene"]["aspectratio"]
    for axis in "xyz":
        low, high = scene[f"{axis}axis"]["range"]
        values = [value for trace in drawn["data"] for value in trace[axis]]
        assert low < min(values) and max(values) < high
    assert np.linalg.norm([ratio[axis] for axis in "xyz"]) == pytest.approx(ROOM)
    spans = [np.ptp(scene[f"{axis}axis"]["range"]) / ratio[axis] for axis in "xyz"]
    assert spans == pytest.approx([spans[0]] * 3)  # no axis is stretched


@pytest.mark.parametrize(
    ("values", "effect", "kind", "leg"),
    [
        ([0.0, 0.2, 0.0], "link-length", "link", 1),
        ([0.0, 0.0, -0.25], "homing-offset", "slider", 2),
    ],
)
def test_a_ghost_is_on_the_part_that_has_the_fault(values: list[float], effect: str, kind: str, leg: int, here: Path):
    entry = {"link-length": "length_mm", "homing-offset": "offset_mm"}[effect]
    text = f'{MACHINE}\n[[effect]]\nname = "{effect}"\n[effect.parameters]\n{entry} = {{ value = {values} }}\n'
    opened = open_both(RUN, text)
    shift = ghosts_of(opened.model, opened.problem, (effect,))["shift"][effect]
    assert legs_at_fault(shift) == (kind, (leg,))
    look = jobs.look(RUN, MACHINE, silent)
    lines = look.drawing.at(5)
    there = moved(lines, shift, 0, 1.0)
    if kind == "link":  # the linear ghost makes the link longer by what it is
        rows = ghosts_of(opened.model, opened.problem, (effect,))["rows"]
        at = look.drawing.at(rows[0])
        grown = np.linalg.norm(np.diff(moved(at, shift, 0, 1.0).chains, axis=1)[:, 0], axis=1) - 300.0
        np.testing.assert_allclose(grown, values, atol=2e-4)
    else:
        assert there.chains[leg, 0, 2] - lines.chains[leg, 0, 2] == pytest.approx(values[leg], abs=1e-6)
    assert 20.0 < usual_times(lines, shift) < 5e4


def test_solids_of_a_machine_are_closed_and_where_the_lines_are(here: Path):
    look = jobs.look(RUN, MACHINE, silent)
    lines = look.drawing.at(0)
    for name, solid in parts_of(lines).items():
        edges = np.sort(
            np.concatenate([solid.faces[:, [0, 1]], solid.faces[:, [1, 2]], solid.faces[:, [2, 0]]]), axis=1
        )
        assert (np.unique(edges, axis=0, return_counts=True)[1] % 2 == 0).all(), name  # every edge has two sides
        assert np.isfinite(solid.points).all() and solid.faces.max() < len(solid.points)
    middle = parts_of(lines)["platform"].points.mean(axis=0)
    np.testing.assert_allclose(middle, look.target[0], atol=0.1)
