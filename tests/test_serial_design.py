"""Observability indices, D-optimal choice of poses, what to measure next, and the joints that make an arm singular."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from ptt.commands.main import app
from ptt.effects.registry import library
from ptt.errors import InputError
from ptt.fitting.indices import observability_indices, project_off
from ptt.machine import load_machine, parse_machine
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.dexterity import condition_number
from ptt.mechanisms.dexterity_report import describe_dexterity
from ptt.mechanisms.dexterity_serial import most_isotropic, scaled_jacobian, singular_families
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.serial_inverse import sample_joints
from ptt.model.model import Model
from ptt.plan.arm import choose_from
from ptt.plan.selection import select_poses
from ptt.run.reading import read_table
from ptt.run.table import make_table
from ptt.run.written import write_table

pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")

MACHINES = Path(__file__).resolve().parents[1] / "data" / "machines"
SIZES = st.lists(st.floats(2.0, 1e4), min_size=1, max_size=6)


def iiwa() -> Serial:
    return build_mechanism(load_machine(MACHINES / "kuka_iiwa.toml").machine)


@given(SIZES, st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_indices_are_those_of_the_singular_values(values: list[float], seed: int) -> None:
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(len(values) + 1,) * 2))[0]
    spread = np.diag([*np.square(values), 1e-9])
    found = observability_indices(turn @ spread @ turn.T, 25)
    low, high = min(values), max(values)
    assert (found.rank, found.parameters, found.poses) == (len(values), len(values) + 1, 25)
    assert found.o1 == pytest.approx(math.prod(values) ** (1 / len(values)) / 5.0, rel=1e-6)
    assert found.o2 == pytest.approx(low / high, rel=1e-6)
    assert found.o3 == pytest.approx(low, rel=1e-6)
    assert found.o4 == pytest.approx(low**2 / high, rel=1e-6)
    assert found.o5 == pytest.approx(1.0 / sum(1.0 / value for value in values), rel=1e-6)
    assert found.o4 <= found.o3 * (1 + 1e-9) and found.o5 <= found.o3 * (1 + 1e-9)


def test_what_is_fitted_beside_is_projected_off() -> None:
    jacobian = np.random.default_rng(0).normal(size=(40, 7))
    own = np.array([0, 3, 4])
    beside = jacobian[:, [1, 2, 5, 6]]
    left = jacobian[:, own] - beside @ np.linalg.lstsq(beside, jacobian[:, own], rcond=None)[0]
    np.testing.assert_allclose(project_off(jacobian.T @ jacobian, own), left.T @ left, rtol=1e-6, atol=1e-8)


def test_what_is_fitted_beside_may_be_unseen_in_a_direction() -> None:
    """As the turn of a frame about the line on which all targets lie: it takes nothing off, and can be solved."""
    jacobian = np.random.default_rng(0).normal(size=(40, 5)) * [1.0, 1.0, 1e6, 1e6, 0.0]
    jacobian[:, 4] = jacobian[:, 3]
    own = np.array([0, 1])
    beside = jacobian[:, 2:4]
    left = jacobian[:, own] - beside @ np.linalg.lstsq(beside, jacobian[:, own], rcond=None)[0]
    np.testing.assert_allclose(project_off(jacobian.T @ jacobian, own), left.T @ left, rtol=1e-3, atol=1e-3)
    jacobian[:, 4] = 0.0
    np.testing.assert_allclose(project_off(jacobian.T @ jacobian, own), left.T @ left, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("seed", [0, pytest.param(3, marks=pytest.mark.long)])
def test_exchange_finds_the_best_of_all_subsets(seed: int) -> None:
    from itertools import combinations

    def log_volume(columns: np.ndarray, chosen: np.ndarray) -> float:
        return float(np.linalg.slogdet(np.eye(5) + np.einsum("nip,niq->pq", columns[chosen], columns[chosen]))[1])

    columns = np.random.default_rng(seed).normal(size=(9, 3, 5))
    found = log_volume(columns, select_poses(columns, 4))
    best = max(log_volume(columns, np.array(rows)) for rows in combinations(range(9), 4))
    assert found >= best - 0.02 * abs(best)
    assert sorted(select_poses(columns, 12)) == list(range(9))


def test_chosen_poses_beat_random_ones_in_every_index() -> None:
    file = load_machine(MACHINES / "ur10.toml")
    q = np.random.default_rng(0).uniform(-2.5, 2.5, (400, 6))
    found = choose_from(Model(file), make_table(None, q), 30, library())
    assert len(set(found.rows)) == 30 and found.effects == ("dh-offsets",)
    assert found.indices.rank >= found.drawn.rank
    assert found.indices.o1 > 1.05 * found.drawn.o1
    assert found.indices.o1 > found.whole.o1  # of the whole list each pose tells less
    with pytest.raises(InputError, match="399 poses that can be driven, of 400 in the list: too few to choose 500"):
        choose_from(Model(file), make_table(None, q), 500, library())


def test_plan_chooses_rows_of_a_list_and_says_what_they_tell(tmp_path: Path) -> None:
    q = np.random.default_rng(1).uniform(-2.0, 2.0, (150, 6))
    write_table(make_table(None, q, joint_prefix="q"), tmp_path / "list.csv")
    command = ["plan", str(MACHINES / "ur10.toml"), "--candidates", str(tmp_path / "list.csv"), "--rows", "25"]
    result = CliRunner().invoke(app, [*command, "--out", str(tmp_path / "chosen.csv"), "--json"])
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    chosen = read_table(tmp_path / "chosen.csv", 6, joint_prefix="q", purpose="targets")
    assert chosen.rows == 25 and all((np.abs(q - row).max(axis=1) < 1e-12).any() for row in chosen.command)
    assert told["chosen"]["o1"] > told["at_random"]["o1"]


def test_iiwa_families_are_elbow_shoulder_and_wrist() -> None:
    found = singular_families(iiwa())
    names = {tuple(joint + 1 for joint in joints): rows for joints, rows in found.items() if len(rows) >= 10}
    assert next(iter(names)) == (4,)  # the elbow comes first
    assert {(4,), (2, 3), (5, 6), (2, 6)} <= set(names)
    shoulder, wrist = names[(2, 3)], names[(5, 6)]
    assert float(shoulder[:, [1, 2]].cos().abs().max()) < 1e-3
    assert float(torch.maximum(wrist[:, 4].cos().abs(), wrist[:, 5].sin().abs()).max()) < 1e-3


def test_iiwa_is_as_even_as_its_elbow_allows() -> None:
    """Wrist point over two equal links: k^2 = 3 at 120 degrees, its limit; free, the golden ratio at 131.8 degrees."""
    arm = iiwa()
    q, number = most_isotropic(arm, "position")
    assert number == pytest.approx(math.sqrt(3.0), rel=1e-6)
    assert abs(float(q[3])) == pytest.approx(math.radians(120.0), abs=1e-6)
    limits = tuple((-math.pi, math.pi) if joint in (1, 3) else limit for joint, limit in enumerate(arm.limits_rad))
    q, number = most_isotropic(replace(arm, limits_rad=limits), "position", starts=12)
    assert number == pytest.approx((1.0 + math.sqrt(5.0)) / 2.0, rel=1e-4)
    assert abs(math.degrees(float(q[3]))) == pytest.approx(2.0 * math.degrees(math.acos(math.sqrt(1.0 / 6.0))), abs=0.3)
    assert float(condition_number(scaled_jacobian(arm, q[None], "position"))) == pytest.approx(number, rel=1e-9)


def test_dexterity_of_an_arm_is_told_and_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from ptt.show.plots import arm_dexterity

    monkeypatch.setattr(arm_dexterity, "SAMPLES", 2_000)
    picture = tmp_path / "iiwa.png"
    result = CliRunner().invoke(app, ["dexterity", str(MACHINES / "kuka_iiwa.toml"), "--plot", str(picture)])
    assert result.exit_code == 0, result.output
    assert "every joint 0.4 rad above the middle of its limits" in result.output
    assert "singular by joint 4" in result.output and "singular by joints 2 and 3" in result.output
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert arm_dexterity.deciding_pairs(iiwa()) == ((1, 2), (3, 5))


FLAT = "joint = [{ a_mm = 400 }, { a_mm = 300 }, { a_mm = 100 }, { a_mm = 100 }]"


@pytest.mark.parametrize(
    "joints",
    [
        "joint = [{ a_mm = 300 }]",
        "joint = [{ alpha_deg = 90, d_mm = 300 }, { a_mm = 400 }]",
        "joint = [{ a_mm = 400 }, { a_mm = 300 }]",
        "joint = [{ alpha_deg = 90, d_mm = 300 }, { a_mm = 400 }, { a_mm = 350 }]",
        FLAT,
    ],
    ids=["one joint", "two", "two, flat", "three", "four, flat: singular everywhere"],
)
def test_dexterity_of_an_arm_of_few_joints_is_drawn(joints: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Dark is singular, so an arm that is singular nowhere has no dark place; a flat workspace is seen all the same."""
    from ptt.show.plots import arm_dexterity
    from ptt.show.plots.common import png

    monkeypatch.setattr(arm_dexterity, "SAMPLES", 2_000)
    arm = Serial.from_spec(parse_machine(f'[machine]\nkind = "serial"\nconvention = "standard"\n{joints}').machine)
    figure = arm_dexterity.draw_arm_dexterity(arm)
    assert png(figure)[:4] == b"\x89PNG"
    panels = [panel for panel in figure.axes if panel.get_xlabel() and panel.collections]
    assert len(panels) == 2 + min(2, math.comb(arm.joints, 2))
    for panel in panels[:2]:
        edges = panel.collections[0].get_coordinates()
        size = np.ptp(edges, axis=(0, 1))
        assert size.min() > 0.05 * size.max()
    for panel in panels[2:]:
        shown = panel.collections[0]
        dark = shown.cmap(shown.norm(np.asarray(shown.get_array())))[..., :3].sum(axis=-1) < 0.9
        assert dark.all() if joints == FLAT else not dark.any()


def test_dexterity_at_targets_that_are_joint_values_is_theirs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a tool position there is nothing to invert, and nothing out of reach: the joints say where they go."""
    monkeypatch.setattr("ptt.mechanisms.dexterity_report._arm_workspace", lambda arm: {"poses": 0})
    file = load_machine(MACHINES / "kuka_iiwa.toml")
    arm = Serial.from_spec(file.machine)  # type: ignore[arg-type]
    q = sample_joints(arm, 4)
    p = torch.full((4, 3), torch.nan, dtype=torch.float64)
    p[3] = arm.forward(q)[3]
    told = describe_dexterity(file, p, q)["targets"]
    assert [entry["status"] for entry in told[:3]] == ["ok"] * 3
    for entry, joints, place in zip(told, q, arm.forward(q), strict=True):
        torch.testing.assert_close(place.new_tensor(entry["p_mm"]), place)
        assert entry["condition"] >= 1.0 and (entry["q"] == joints.tolist() or entry is told[3])


@pytest.mark.parametrize("joints", ["joint = [{ alpha_deg = 90 }, {}]", "joint = [{ a_mm = 300 }, { a_mm = 200 }]"])
def test_an_arm_that_moves_in_two_directions_only_can_be_driven(joints: str) -> None:
    """A mount of two axes and a flat arm are singular nowhere that matters; the flat arm stretched out is."""
    from ptt.plan.space import build_space, can_drive

    text = f'[machine]\nkind = "serial"\nconvention = "standard"\ntool_mm = [400, 0, 0]\n{joints}\n'
    space = build_space(parse_machine(text))
    q = torch.tensor([[0.3, 0.7], [-1.0, -0.9], [0.5, 1e-4]], dtype=torch.float64)
    assert can_drive(space, q).tolist() == [True, True, "a_mm" not in joints]
