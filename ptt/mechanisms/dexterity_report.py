"""Dexterity of a machine as a report: at home, at given targets, over the workspace."""

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

from ptt.machine import MachineFile
from ptt.mechanisms import Mechanism, build_mechanism
from ptt.mechanisms.dexterity import condition_number, determinant, manipulability, singularities
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.serial_inverse import middle, sample_joints
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.mechanisms.workspace import NEAR_SINGULAR, OK, reach, reached_box, workspace_map

GRID = 41  # points along x and along y
HEIGHTS = 9  # points along z
MARGINS = ("inverse_mm", "edge_mm", "inverse", "direct", "constraint")


def describe_dexterity(
    file: MachineFile, targets: Tensor | None = None, commands: Tensor | None = None
) -> dict[str, Any]:
    """Condition number, manipulability and distance from singularities of a machine.

    Args:
        file: the machine.
        targets: (n, 3) mm, tool positions to look at besides home; None for none.
        commands: (n, k) mm or rad, joint values that stand for targets that are NaN; None for none.

    Returns:
        'machine', 'kind', 'home', 'targets' (one entry each, in order) and 'workspace'.
    """
    mechanism = build_mechanism(file.machine)
    if isinstance(mechanism, ThreePtt):
        centre = torch.zeros(1, 3, dtype=torch.float64)
        home, workspace = _at(mechanism, centre, mechanism.inverse(centre)), _over_workspace(mechanism)
    else:
        assert isinstance(mechanism, Serial)
        home, workspace = _arm_at_middle(mechanism), _arm_workspace(mechanism)
    data: dict[str, Any] = {
        "machine": file.machine.name,
        "kind": file.machine.kind,
        "home": home[0],
        "workspace": workspace,
    }
    data["targets"] = [] if targets is None else _at(mechanism, *_poses(mechanism, targets, commands))
    return data


def _poses(mechanism: Mechanism, p: Tensor, q: Tensor | None) -> tuple[Tensor, Tensor]:
    """Tool positions (n, 3) mm and joint values (n, k), each from the other where that alone is given."""
    if q is None:
        return p, mechanism.inverse(p)
    wanted = torch.isfinite(p).all(dim=-1, keepdim=True)
    p = torch.where(wanted, p, mechanism.forward(q))
    return p, torch.where(wanted, mechanism.inverse(p), q) if wanted.any() else q


def _at(mechanism: Mechanism, p: Tensor, q: Tensor) -> list[dict[str, Any]]:
    """Dexterity at each tool position (n, 3) mm, reached by joint values (n, k)."""
    columns: dict[str, Sequence[Any]] = {
        "p_mm": p.tolist(),
        "q": q.tolist(),
        "status": reach(mechanism, p, q).tolist(),
    }
    if isinstance(mechanism, ThreePtt):  # from p, not q: at a singularity slider heights do not determine the pose
        margins = singularities(mechanism, p)
        columns |= {name: getattr(margins, name).tolist() for name in ("condition", "manipulability")}
        columns["determinant"] = (determinant(mechanism, p) + 0.0).tolist()
        columns |= {name: getattr(margins, name).tolist() for name in MARGINS}
    else:
        jacobian = mechanism.jacobian(q)
        columns["condition"] = condition_number(jacobian).tolist()
        columns["manipulability"] = manipulability(jacobian).tolist()
    return [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]


def _over_workspace(mechanism: ThreePtt) -> dict[str, Any]:
    """Range of the condition number over a grid of the positions that the sliders' travel reaches."""
    least, most = reached_box(mechanism)
    half = float(torch.maximum(-least, most)[:2].max())
    across = torch.linspace(-half, half, GRID, dtype=torch.float64)  # with the middle, where the condition is best
    heights = torch.linspace(float(least[2]), float(most[2]), HEIGHTS, dtype=torch.float64)
    found = workspace_map(mechanism, across, across, heights)
    inside = ~torch.isnan(found.condition) & (found.travel_margin >= 0.0)
    values = found.condition[inside]
    if not len(values):
        return {"poses": 0}
    grid = torch.stack(torch.meshgrid(heights, across, across, indexing="ij")[::-1], -1)[inside]
    near = reach(mechanism, grid) == NEAR_SINGULAR
    return {
        "poses": len(values),
        "condition": {"least": float(values.min()), "median": float(values.median()), "largest": float(values.max())},
        "near_singular_share": float(near.mean()),
    }


def _arm_at_middle(arm: Serial) -> list[dict[str, Any]]:
    """Dexterity of an arm at the bent middle of its limits; its module loads scipy's optimisers, so only here."""
    from ptt.mechanisms.dexterity_serial import scaled_jacobian

    q = middle(arm)[None]
    jacobian = scaled_jacobian(arm, q)
    entry = {"q": q[0].tolist(), "p_mm": arm.forward(q)[0].tolist(), "status": OK}
    return [entry | {"condition": float(condition_number(jacobian)), "manipulability": float(manipulability(jacobian))}]


def _arm_workspace(arm: Serial) -> dict[str, Any]:
    """Range of the condition number over sampled joint values, most isotropic poses and singular families of an arm."""
    from ptt.mechanisms.dexterity_serial import most_isotropic, scaled_jacobian, singular_families

    values = condition_number(scaled_jacobian(arm, sample_joints(arm, 4096)))
    best, least = most_isotropic(arm)
    best_position, least_position = most_isotropic(arm, "position")
    families = singular_families(arm)
    total = sum(len(rows) for rows in families.values())
    return {
        "poses": len(values),
        "condition": {"least": least, "median": float(values.median()), "largest": float(values.max())},
        "most_isotropic_q": best.tolist(),
        "most_isotropic_position": {"q": best_position.tolist(), "condition": least_position},
        "singular": [
            {"joints": [joint + 1 for joint in joints], "share": len(rows) / total, "q": rows[0].tolist()}
            for joints, rows in families.items()
        ],
        "length_mm": arm.length_mm,
    }
