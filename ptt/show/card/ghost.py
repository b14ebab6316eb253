"""The machine as lines at some poses, and the displacement of its parts by each effect, drawn enlarged as a ghost.

The displacement is the difference of the model's causal chain with and without the effect, so that every effect has a
ghost, one of a user's own too. It is enlarged linearly.
"""

from typing import Any

import numpy as np
import torch

from ptt.mechanisms.serial import Serial
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.model.chain import predict
from ptt.model.model import Model
from ptt.run.problem import Problem
from ptt.run.view import View
from ptt.show.card.scene import POSES, MachineLines
from ptt.show.sizing import spread


def poses_of(problem: Problem) -> np.ndarray:
    """At most `POSES` of the used rows, evenly spaced along the travel, (m,) int."""
    rows = np.flatnonzero(problem.used)
    return rows[spread(len(rows), POSES)]


def machine_lines(problem: Problem) -> MachineLines:
    """The nominal machine at the commands of each row, as lines.

    Args:
        problem: n rows.

    Returns:
        The lines.
    """
    view, spec = problem.view, problem.file.machine
    mechanism, q, p = view.mechanism, view.q.numpy(), view.p.numpy()
    if isinstance(mechanism, Serial):
        origins = mechanism.frames(view.q)[0].numpy()
        chain = np.concatenate([np.zeros((len(q), 1, 3)), origins, p[:, None]], axis=1)
        return MachineLines(np.zeros((0, 2, 3)), chain[:, None], np.zeros((len(q), 0, 3)))
    assert isinstance(mechanism, ThreePtt) and spec.kind == "three-ptt"
    azimuth = np.radians(spec.slider_azimuth_deg)
    corner = spec.platform_radius_mm * np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(3)], axis=1)
    foot, rail = mechanism.foot.numpy() + corner, mechanism.rail.numpy()
    ends = np.asarray(spec.travel_ends)
    rails = foot[:, None] + ends[:, :, None] * rail[:, None]
    sliders = foot[None] + q[:, :, None] * rail[None]
    platform = p[:, None] + corner[None]
    return MachineLines(rails, np.stack([sliders, platform], axis=2), platform)


def ghosts_of(model: Model, problem: Problem, keys: tuple[str, ...]) -> dict[str, Any]:
    """Displacement of the machine's parts by each effect, at some poses.

    Args:
        model: with the effects at their values.
        problem: the readings.
        keys: keys of the effects.

    Returns:
        'rows': the m poses. 'shift': effect -> its displacements in mm as nested lists, and its 'stage'. Of a 3-PTT
        'rails' (3, 2, 3), 'sliders' (m, 3, 3), 'platform' (m, 3), 'grown' (m, 3) length added to each link, and 'share'
        (3, 3): for slider, tower and link of each leg the largest displacement over all rows. Of an arm 'chain' (m, p,
        3), 'platform' (m, 3), and 'share' (1, k) of each joint.
    """
    terms = [(term.effect, term.theta) for term in model.terms]
    view, rows = problem.view, poses_of(problem)
    with torch.no_grad():
        whole = predict(terms, view)
        shift = {}
        for key in keys:
            less = predict([term for term in terms if term[0].key != key], view)
            moved = whole.q - less.q, (whole.geometry - less.geometry).expand(view.rows, -1), whole.p - less.p
            own = next(term for term in terms if term[0].key == key)[0]
            serial = isinstance(view.mechanism, Serial)
            found = (_arm if serial else _legs)(view, rows, *moved)
            shift[key] = found | {"stage": own.stage}
    return {"rows": rows.tolist(), "shift": shift}


def _legs(view: View, rows: np.ndarray, dq: torch.Tensor, geometry: torch.Tensor, dp: torch.Tensor) -> dict[str, Any]:
    """Displacement of the parts of a 3-PTT, as `ghosts_of` returns it."""
    mechanism = view.mechanism
    assert isinstance(mechanism, ThreePtt)
    slots = geometry[:, :12].reshape(-1, 3, 4).numpy()
    centre, grown = slots[..., :3], slots[..., 3]
    slider = centre + dq.numpy()[..., None] * mechanism.rail.numpy()
    q, ends = view.q.numpy(), mechanism.limits().numpy()
    rails = np.stack([_at_ends(q[:, leg], centre[:, leg], ends[:, leg]) for leg in range(3)])
    share = np.stack(
        [np.abs(dq.numpy()).max(axis=0), np.linalg.norm(centre, axis=2).max(axis=0), np.abs(grown).max(axis=0)]
    )
    return {
        "rails": _rounded(rails), "sliders": _rounded(slider[rows]), "platform": _rounded(dp.numpy()[rows]),
        "share": _rounded(share), "grown": _rounded(grown[rows]),
    }  # fmt: skip


def _at_ends(q: np.ndarray, shift: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Shift of a rail at both ends of its travel, (2, 3) mm, by a straight line fitted to its shifts along it."""
    about = q - q.mean()
    slope = (about @ (shift - shift.mean(axis=0))) / max(float(about @ about), 1e-12)
    return shift.mean(axis=0) + (ends - q.mean())[:, None] * slope


def _arm(view: View, rows: np.ndarray, dq: torch.Tensor, geometry: torch.Tensor, dp: torch.Tensor) -> dict[str, Any]:
    """Displacement of the joints and the tool of an arm, as `ghosts_of` returns it."""
    arm = view.mechanism
    assert isinstance(arm, Serial)
    q, own = view.q[rows], geometry[rows]
    nominal = arm.frames(q)[0]
    moved = arm.frames(q + dq[rows], own if own.shape[1] == len(arm.slots) else None)[0]
    place = (moved - nominal).numpy()
    jumps = np.linalg.norm(np.diff(np.concatenate([np.zeros((len(rows), 1, 3)), place], axis=1), axis=1), axis=2)
    share = np.maximum(np.abs(dq.numpy()).max(axis=0) * arm.length_mm, jumps.max(axis=0)[: dq.shape[1]])
    chain = np.concatenate([np.zeros((len(rows), 1, 3)), place, dp.numpy()[rows][:, None]], axis=1)
    return {"chain": _rounded(chain), "platform": _rounded(dp.numpy()[rows]), "share": _rounded(share[None])}


def _rounded(values: np.ndarray) -> list[Any]:
    return np.round(values, 7).tolist()
