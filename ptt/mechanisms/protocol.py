"""What every mechanism offers to the rest of the program: its kinematics, batched and differentiable."""

from typing import Protocol

from torch import Tensor


class Mechanism(Protocol):
    """Kinematics of one machine: batched, float64 and differentiable.

    Arguments and results are torch tensors; `torch.as_tensor` makes one of a numpy array, `.numpy()` an array of it.
    A pose that does not exist gives a row of NaN, because a mask costs nothing in a batch; `ptt.run.reach` refuses such
    rows of a table by file, row and columns.
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
