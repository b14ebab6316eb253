"""One parameter of an effect: name, unit, usual size, bounds, what it means."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Attributes:
        stem: name without its unit.
        unit: unit on a 3-PTT; for an axis quantity `mm` becomes `rad` on a serial arm.
        usual: size it usually has; scales the fit and holds what the data cannot see, bounds nothing.
        meaning: one line.
        per_joint: one value (or `count` values) for each joint or leg.
        count: values, for each joint where `per_joint`.
        onward: one value for each pair of a joint and a link that it carries, its own first; joint by joint.
        lower: physical lower bound.
        upper: physical upper bound.
        most: value beyond which no fit goes, though a file may hold it: there it would be something else.
        within: usual sizes below which the cause would be another, so that no diagnosis names it, and above which it
            names it only where the readings show its form clearly; a fit may end there all the same, and a file hold
            it. None where any size may be.
        role: 'linear'; 'searched' (enters the shape smoothly, start found by search); 'given' (set by search, held in
            the fit).
        axis: measured along the axis, so its unit follows the joint's.
        usual_rad: usual size on a serial arm, where it differs.
        held: kept near zero at its usual size by a prior, because the effect is defined without it; what data of
            finite length leave of it is small.
        lent: effects whose own cause each of the `count` held values is. Where such an effect is not in the model, the
            fit frees the value: else the rest of the effect would have to imitate it.
        fine: detail of the parameter before it, mostly far under the noise: how large it is is learned by itself.
            Declared after all other linear parameters; an effect is tried without it and has it once it is in a model.
        bands: numbers of its `count` values: in a diagnosis those of one number share how large they are, for each
            joint; () all of them do.
        joined: shares with the parameter before it how large it is: of one cause, their proportion is known.
        default: value that goes without saying, so that files and lists leave it out and none of them is older for it;
            None where it is always said.
    """

    stem: str
    unit: str
    usual: float
    meaning: str
    per_joint: bool = False
    count: int = 1
    lower: float = -float("inf")
    upper: float = float("inf")
    most: float = float("inf")
    within: tuple[float, float] | None = None
    role: Literal["linear", "searched", "given"] = "linear"
    axis: bool = False
    usual_rad: float | None = None
    held: bool = False
    lent: tuple[str, ...] = ()
    onward: bool = False
    fine: bool = False
    bands: tuple[int, ...] = ()
    joined: bool = False
    default: float | None = None

    @property
    def shapes(self) -> bool:
        """Whether a search has to find out what it is before there is an effect at all."""
        return self.role != "linear" and self.default is None

    @property
    def apart(self) -> bool:
        """Whether a search begins with one value for all joints, of which each then has its own."""
        return self.role == "searched" and self.per_joint

    def size(self, joints: int) -> int:
        """Number of values on a mechanism with k joints."""
        if self.onward:
            return joints * (joints + 1) // 2
        return self.count * joints if self.per_joint else self.count

    def on(self, kind: str) -> "Parameter":
        """The parameter as it is on a mechanism family.

        Args:
            kind: 'three-ptt' or 'serial'.

        Returns:
            The same parameter with the unit and usual size of that family, and bounds as far from it as they were.
        """
        if kind == "three-ptt" or not self.axis:
            return self
        unit = self.unit.replace("mm", "rad").replace("N", "Nmm")
        values = {**self.__dict__, "unit": unit, "axis": False}
        usual = self.usual if self.usual_rad is None else self.usual_rad
        bounds = {name: values[name] * usual / self.usual for name in ("lower", "upper", "most")}
        return Parameter(**(values | bounds | {"usual": usual}))

    @property
    def name(self) -> str:
        """Key in files and JSON: stem and unit, as in `gap_mm` or `growth_per_k`."""
        suffix = self.unit.lower().replace(" ", "").replace("/", "_per_").removeprefix("1_")
        return self.stem if suffix in ("", "1") else f"{self.stem}_{suffix}"
