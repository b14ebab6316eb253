"""One parameter of an effect: name, unit, usual size, bounds, what it means."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Attributes:
        stem: name without its unit.
        unit: unit on a 3-PTT; for an axis quantity `mm` becomes `rad` on a serial arm.
        usual: size that it usually has; scales the fit and the prior on directions that the data do not see, and is no
            bound.
        meaning: one line.
        per_joint: one value (or `count` values) for each joint or leg.
        count: number of values, for each joint where `per_joint`.
        onward: one value for each pair of a joint and a link behind it, its own link first; joint by joint.
        lower: physical lower bound.
        upper: physical upper bound.
        most: upper limit of fits, though a file may hold more: beyond it the shape is that of another effect.
        within: limits in usual sizes. Below the first the cause would be another, and no diagnosis names the effect;
            above the second it does so only where the readings show the form clearly. Neither bounds a fit or a file.
            None for no limits.
        role: 'linear'; 'searched' (enters the shape smoothly; the fit refines what the search found); 'given' (set by
            the search, constant in the fit).
        axis: measured along the axis, so its unit follows the joint's.
        usual_rad: usual size on a serial arm, where it differs.
        held: kept near zero by a prior of its usual size, because the effect is defined without it; over the finite
            range of the data a little of it remains. So may a searched one be.
        lent: for each of the `count` held values the effect that it belongs to. Where that effect is not in the model
            the fit frees the value, since other values would have to imitate it.
        fine: detail of the parameter before it, mostly far below the noise, with a learned variance of its own.
            Declared after all other linear parameters; a diagnosis tries an effect without it, a model has it.
        bands: group number of each of the `count` values; in a diagnosis those of one group share a learned variance,
            for each joint. () puts all in one group.
        joined: shares its learned variance with the parameter before it: of one cause, their proportion is known.
        at_beginnings: its values are those at the first of `View.beginnings`, in their order; further ones are zero.
        default: value at which files and lists leave the parameter out, so that files from before it existed stay
            valid; None where it is always written.
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
    at_beginnings: bool = False

    @property
    def apart(self) -> bool:
        """Whether it has a value for each joint; a search starts all of them from one common value."""
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
            The same parameter with the unit and usual size of that family, and its bounds scaled in proportion.
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
