"""Numbers as people read them."""

import math
from collections.abc import Mapping

from ptt.run.axes import AXES_TOTAL

NO_CHANCE = 1e-12  # smaller chances are all the same to a reader
NONE = "\N{EM DASH}"
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def um(value: float | None, digits: int = 1) -> str:
    """A length in um, to a tenth; a dash for none.

    Args:
        value: um.
        digits: after the point.

    Returns:
        Text.
    """
    if value is None or not math.isfinite(value):
        return NONE
    plain = round(float(value), digits) + 0.0  # what rounds to zero has no sign
    return f"{plain:.{digits}f}".replace("-", "\N{MINUS SIGN}")


def axes(figures: Mapping[str, float]) -> tuple[str, ...]:
    """x, y, z and total of a dictionary of figures in um."""
    return tuple(um(figures[axis]) for axis in AXES_TOTAL)


def chance(p_value: float | None) -> str:
    """A p-value.

    Args:
        p_value: 0 to 1.

    Returns:
        Text.
    """
    if p_value is None:
        return NONE
    return f"< {_power(-12)}" if p_value < NO_CHANCE else _plain(p_value, 1)


def plus_minus(value: float, std: float | None) -> str:
    """A value to the second digit of its standard error, both under one power of ten.

    Args:
        value: any unit.
        std: its standard error; None for none.

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
