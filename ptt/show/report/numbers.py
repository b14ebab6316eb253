"""Numbers as text."""

import math
from collections.abc import Mapping

from ptt.run.axes import AXES_TOTAL

NO_CHANCE = 1e-12  # p-values below are shown as less than this
NONE = "\N{EM DASH}"
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def um(value: float | None, digits: int = 1) -> str:
    """A number, usually of micrometres, with fixed decimal places; a dash for none.

    Args:
        value: in um.
        digits: number of decimal places.

    Returns:
        Text.
    """
    if value is None or not math.isfinite(value):
        return NONE
    plain = round(float(value), digits) + 0.0  # turns -0.0 into 0.0
    return f"{plain:.{digits}f}".replace("-", "\N{MINUS SIGN}")


def axes(figures: Mapping[str, float]) -> tuple[str, ...]:
    """Text of the values at x, y, z and total, um."""
    return tuple(um(figures[axis]) for axis in AXES_TOTAL)


def chance(p_value: float | None) -> str:
    """A p-value, 0 to 1, to one significant digit; a dash for none."""
    if p_value is None:
        return NONE
    return f"< {_power(-12)}" if p_value < NO_CHANCE else _plain(p_value, 1)


def plus_minus(value: float, std: float | None) -> str:
    """A value to the second significant digit of its standard error, both times one power of ten.

    Args:
        value: in any unit.
        std: standard error in that unit; None for none.

    Returns:
        For example '0.0552 ± 0.0013' or '(2.73 ± 0.51) × 10⁻⁵'.
    """
    if std is None or not math.isfinite(std) or std <= 0.0:
        return _plain(value, 4)
    size = max(abs(value), std)
    power = math.floor(math.log10(size))
    shift = power if power < -3 or power > 5 else 0
    digits = max(0, 1 - math.floor(math.log10(std)) + shift)
    text = f"{value / 10.0**shift:.{digits}f} \N{PLUS-MINUS SIGN} {std / 10.0**shift:.{digits}f}"
    text = text.replace("-", "\N{MINUS SIGN}")
    return f"({text}) \N{MULTIPLICATION SIGN} {_power(shift)}" if shift else text


def _plain(value: float, digits: int) -> str:
    mantissa, _, exponent = f"{value:.{digits}g}".replace("e-0", "e-").replace("e+0", "e").partition("e")
    mantissa = mantissa.replace("-", "\N{MINUS SIGN}")
    return f"{mantissa} \N{MULTIPLICATION SIGN} {_power(int(exponent))}" if exponent else mantissa


def _power(exponent: int) -> str:
    return f"10{str(exponent).translate(SUPERSCRIPT)}"
