"""What every mechanism offers to the rest of the program, and the checks that refuse poses out of reach."""

from collections.abc import Sequence
from typing import Protocol

import torch
from torch import Tensor

from ptt.errors import WorkspaceError

ROWS_SHOWN = 5  # in a message


class Mechanism(Protocol):
    """Kinematics of one machine: batched, float64 and differentiable.

    Arguments and results are torch tensors; `torch.as_tensor` makes one of a numpy array, `.numpy()` an array of it.
    A pose that does not exist gives a row of NaN, because a mask costs nothing in a batch; whoever hands rows on to a
    user calls `require_reachable` or `require_assembled` first.
    """

    @property
    def joints(self) -> int:
        """Number of joints, k."""

    @property
    def slots(self) -> tuple[str, ...]:
        """Names, with units, of the G geometry shifts that `forward` and `inverse` accept."""

    def forward(self, q: Tensor, geometry: Tensor | None = None) -> Tensor:
        """Tool position of joint values.

        Args:
            q: float64 tensor (n, k) mm or rad, joint values.
            geometry: (n, G) or (1, G), shift of each geometry slot; None is the drawing.

        Returns:
            p: (n, 3) mm, NaN where the mechanism cannot be assembled.
        """

    def inverse(self, p: Tensor, geometry: Tensor | None = None, near: Tensor | None = None) -> Tensor:
        """Joint values of a tool position.

        Args:
            p: float64 tensor (n, 3) mm, tool positions.
            geometry: (n, G) or (1, G), shift of each geometry slot; None is the drawing.
            near: (n, k) mm or rad, joint values to start from and stay close to; not used by a 3-PTT, which has one
                solution.

        Returns:
            q: (n, k) mm or rad, NaN where the position is out of reach.
        """

    def jacobian(self, q: Tensor, geometry: Tensor | None = None) -> Tensor:
        """Derivative of the tool position by the joint values.

        Args:
            q: float64 tensor (n, k) mm or rad, joint values.
            geometry: (n, G) or (1, G), shift of each geometry slot; None is the drawing.

        Returns:
            dp/dq: (n, 3, k) mm per mm or mm per rad.
        """

    def home(self) -> Tensor:
        """Home position: the joint values from which drive errors count the travel.

        Returns:
            q0: (k,) mm or rad.
        """

    def limits(self) -> Tensor:
        """Ends of travel.

        Returns:
            (2, k) mm or rad, lower ends first, infinite where there is none.
        """


def reachable(mechanism: Mechanism, p: Tensor) -> Tensor:
    """Mask of the tool positions that the mechanism can reach.

    Args:
        mechanism: the machine.
        p: (n, 3) mm, tool positions.

    Returns:
        (n,) bool.
    """
    return torch.isfinite(mechanism.inverse(p)).all(-1)


def require_reachable(mechanism: Mechanism, p: Tensor, where: str = "", lines: Sequence[int] | None = None) -> Tensor:
    """Joint values of tool positions that must all be within reach.

    Args:
        mechanism: the machine.
        p: (n, 3) mm, tool positions.
        where: file that the rows come from, for the message.
        lines: (n,) line numbers to name in the message instead of zero-based rows.

    Returns:
        q: (n, k) mm or rad, all finite.

    Raises:
        WorkspaceError: a position is out of reach; it names the rows.
    """
    q = mechanism.inverse(p)
    fix = "check the units and the machine file, or take these targets out"
    _refuse_nonfinite(q, "no joint values reach the target", fix, where, lines)
    return q


def require_assembled(mechanism: Mechanism, q: Tensor, where: str = "", lines: Sequence[int] | None = None) -> Tensor:
    """Tool positions of joint values at which the mechanism must close.

    Args:
        mechanism: the machine.
        q: (n, k) mm or rad, joint values.
        where: file that the rows come from, for the message.
        lines: (n,) line numbers to name in the message instead of zero-based rows.

    Returns:
        p: (n, 3) mm, all finite.

    Raises:
        WorkspaceError: the links do not meet at some joint values; it names the rows.
    """
    p = mechanism.forward(q)
    fix = "check the units, the slider zeros and the link lengths"
    _refuse_nonfinite(p, "the links do not meet at these joint values", fix, where, lines)
    return p


def _refuse_nonfinite(values: Tensor, what: str, fix: str, where: str, lines: Sequence[int] | None) -> None:
    """Raise WorkspaceError naming the rows of `values` (n, m) that hold anything but numbers."""
    finite = torch.isfinite(values.detach()).all(-1)
    if bool(finite.all()):
        return
    rows = torch.nonzero(~finite).flatten().tolist()
    shown = [lines[row] if lines is not None else row for row in rows[:ROWS_SHOWN]]
    noun = "line" if lines is not None else "row"
    named = f"{noun}{'s' if len(rows) > 1 else ''} {', '.join(map(str, shown))}"
    more = f" and {len(rows) - ROWS_SHOWN} more" if len(rows) > ROWS_SHOWN else ""
    raise WorkspaceError(f"{what}: {named}{more} ({len(rows)} of {len(finite)} rows)", rows, where=where, fix=fix)
