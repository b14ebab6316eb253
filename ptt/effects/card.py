"""Card of an effect: cause, equation, source, fingerprint, what it is confused with, remedy."""

from dataclasses import dataclass, replace

RESIDUALS = ("joint", "x", "y", "z")


@dataclass(frozen=True)
class Card:
    """One effect described for a person at the machine.

    Attributes:
        cause: what is physically wrong.
        equation: the additive shift, as the code computes it.
        source: where the equation comes from.
        size: what is usual on real machines.
        fingerprint: what it looks like in the residual.
        confused_with: pairs of an effect, or another cause, and the measurement that tells the two apart.
        remedy: how it is corrected on the machine.
        needs: what the data must hold for it to be tested; '-' for nothing beyond poses.
        residual: component of the residual that its picture shows, one of `RESIDUALS`; 'joint' is J e, the error in
            joint coordinates.
        telling: variable that the residual follows, the abscissa of its picture, one of `ptt.show.telling.VARIABLES`.
        shade: second variable that matters, the colour of its picture, one of these, or ''.
        arm_cause: the cause on a serial arm, which has no screws and rails; '' for the same words.
        arm_size: what is usual on an arm.
        arm_fingerprint: what it looks like on an arm.
        arm_remedy: how it is corrected on an arm.
    """

    cause: str
    equation: str
    source: str
    size: str
    fingerprint: str
    confused_with: tuple[tuple[str, str], ...]
    remedy: str
    needs: str = "-"
    residual: str = "joint"
    telling: str = "b"
    shade: str = ""
    arm_cause: str = ""
    arm_size: str = ""
    arm_fingerprint: str = ""
    arm_remedy: str = ""

    def on(self, kind: str) -> "Card":
        """The card in the words of a mechanism family.

        Args:
            kind: 'three-ptt' or 'serial'.

        Returns:
            The same card, on an arm with its arm_ texts in place of the others.
        """
        if kind != "serial":
            return self
        own = {name: getattr(self, f"arm_{name}") for name in ("cause", "size", "fingerprint", "remedy")}
        return replace(self, **{name: words for name, words in own.items() if words})
