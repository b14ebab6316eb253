"""Places where unknown physics may act: the tool and its mount, joints, rails sideways, links, the tracker's set-up."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, cast

import numpy as np

from ptt.effects.dh_offsets import links_along
from ptt.effects.geometry import ACROSS, across_axes
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.statics import load_levers
from ptt.model.chain import Chain
from ptt.run.axes import AXES
from ptt.run.frames import rigid_columns
from ptt.run.problem import Problem

FEATURE_SIZE = 0.02  # mm at the tool: unit of a block's features, which the learned variance multiplies
LEAST_TURN = 0.05  # rms by which the mount's directions turn, below which the tool in its holder moves as the tool does
STILL_LEVER = 1e-6  # mm or less of the tool per mm or rad of a place: it moves nothing

PlaceKind = Literal["tool", "slider", "joint", "rail", "link", "set-up", "mount", "load"]


@dataclass(frozen=True)
class Place:
    """Where something unknown may act.

    Attributes:
        kind: a slider, the joint of an arm, a rail across its slider's travel, a link's length, the tool, the
            set-up, the mount of an arm's tool in its holder, or the centre of an arm's load.
        residual: its name: 'slider 2', 'joint 2', 'link 2', 'rail 2' (both directions across it), 'tool', 'set-up'
            'mount' or 'load'; of a single direction 'rail 2 outward', 'rail 2 sideways', or 'x', 'y', 'z' of the tool.
        slopes: shift of the reading by each of its w directions, (n, 3, w), scaled to about unit size.
        joint: the joint it belongs to, from 0; None for the tool, the set-up and the mount.
        lever: root mean square of the slopes before scaling, mm per mm or rad.
    """

    kind: PlaceKind
    residual: str
    slopes: np.ndarray
    joint: int | None = None
    lever: float = 1.0

    @property
    def part(self) -> tuple[PlaceKind, int | None]:
        """The part of the machine, whichever of its directions: rail 2, of 'rail 2 outward'."""
        return self.kind, self.joint

    def times(self, shapes: np.ndarray) -> np.ndarray:
        """Features (n, 3, w s) mm of shapes (n, s) that act here."""
        joined = FEATURE_SIZE * self.slopes[:, :, :, None] * shapes[:, None, None, :]
        return joined.reshape(*self.slopes.shape[:2], -1)


def places_of_chain(problem: Problem, chain: Chain, levers: Mapping[str, float] | None = None) -> list[Place]:
    """Where something unknown may act: the tool first, then joints that move it, then rails sideways, then links.

    Args:
        problem: n rows.
        chain: linearisation of the present model, for how joints and rails move the reading.
        levers: name of a place -> its lever, where other rows of the run have determined it.
    """
    n, k = problem.view.rows, problem.view.joints
    places = [Place("tool", "tool", np.broadcast_to(np.eye(3), (n, 3, 3)))]
    by_joint, is_tripod = chain.by_joint.numpy(), problem.file.machine.kind == "three-ptt"
    kind: PlaceKind = "slider" if is_tripod else "joint"
    found = [(kind, by_joint[:, :, joint : joint + 1], joint) for joint in range(k)]
    if is_tripod:
        by_slot = chain.by_slot.numpy()
        ways = np.stack([axis.numpy() for axis in across_axes(problem.view)], axis=-1)  # shape: (leg, xyz, 2)
        found += [("rail", by_slot[:, :, 4 * leg : 4 * leg + 3] @ ways[leg], leg) for leg in range(k)]
        found += [("link", by_slot[:, :, 4 * leg + 3 : 4 * leg + 4], leg) for leg in range(k)]
    else:
        along = links_along(cast(Serial, problem.view.mechanism))
        found += [("link", chain.by_slot.numpy() @ along[:, link : link + 1].numpy(), link) for link in range(k)]
    for kind, slopes, joint in found:
        residual = f"{kind} {joint + 1}"
        lever = (levers or {}).get(residual, float(np.sqrt(np.square(slopes).sum(axis=1).mean())))
        if lever > STILL_LEVER:
            places.append(Place(kind, residual, slopes / lever, joint, lever))
    return places


def tool_axes(tool: Place) -> list[Place]:
    """The tool split into the axes of the base."""
    return [Place("tool", axis, tool.slopes @ unit[:, None]) for axis, unit in zip(AXES, np.eye(3), strict=True)]


def one_way_each(place: Place) -> list[Place]:
    """A place split into its directions: a rail outward and sideways, any other as it is."""
    directions = np.split(place.slopes, place.slopes.shape[2], axis=2)
    called = [f"{place.residual} {to}" for to in ACROSS] if len(directions) > 1 else [place.residual]
    return [replace(place, residual=name, slopes=slopes) for name, slopes in zip(called, directions, strict=True)]


def stand_of(problem: Problem) -> Place:
    """The set-up as a place: rigid motions of the readings, rotations scaled to the radius of the positions."""
    p = problem.view.p
    middle = p.mean(dim=0)
    radius = max(float((p - middle).square().sum(dim=1).mean().sqrt()), 1e-9)
    return Place("set-up", "set-up", rigid_columns(p, middle, radius).numpy())


def mount_of(problem: Problem, chain: Chain) -> Place | None:
    """How the tool of an arm may move in its holder, as a place: along the directions of the last link.

    Args:
        problem: n rows.
        chain: linearisation of the present model.

    Returns:
        None for a machine whose tool only translates, or a run in which it hardly turns.
    """
    slopes = chain.by_slot.numpy()[:, :, -3:]
    turned = float(np.sqrt(np.square(slopes - slopes.mean(axis=0)).mean()))
    return None if problem.file.machine.kind == "three-ptt" or turned < LEAST_TURN else Place("mount", "mount", slopes)


def load_of(problem: Problem, chain: Chain) -> Place | None:
    """The centre of an arm's load as a place: joints that yield to it turn further where it lies beside the tool point.

    Args:
        problem: n rows of an arm.
        chain: linearisation of the present model.

    Returns:
        A direction for each joint and each axis of the tool; None where none of them moves the reading.
    """
    view = problem.view
    levers = load_levers(cast(Serial, view.mechanism), view.q, view.gravity).numpy()
    slopes = np.einsum("ncj,nji->ncji", chain.by_joint.numpy(), levers).reshape(view.rows, 3, -1)
    size = float(np.sqrt(np.square(slopes).sum(axis=1).mean()))
    return Place("load", "load", slopes / size, lever=size) if size > STILL_LEVER else None
