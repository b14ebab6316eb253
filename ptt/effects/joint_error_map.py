"""Periodic errors of an arm's joints: encoder rings and gears, as a Fourier series of each joint angle."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from ptt.effects.base import Effect, Parameter, Stage
from ptt.effects.card import Card
from ptt.effects.layout import per_joint
from ptt.effects.phrases import Phrase, ValuePhrase, said
from ptt.run.view import View

ROWS_A_JOINT = 100  # fewest rows for each joint: its map has 128 values
PLACES = 721  # angles of a joint's range among which extremes are looked for: half a degree apart over a turn
SLOW, FAST = 32, 32  # harmonics: the first 32 of a turn, and 32 smaller ones above them
# An eccentric ring gives the first two harmonics, a gear the next few, its teeth and the ring's lines high ones; each
# band has a learned variance of its own. One cause spans about a factor of three, and few variances are learned better.
BANDS = (0,) * 2 + (1,) * 6 + (2,) * (SLOW - 8)


@dataclass(frozen=True)
class JointErrorMap(Effect):
    """Each joint turns unevenly, alike at every turn: sum over m of a_m cos(m q) + b_m sin(m q).

    Encoder rings, their eccentricity and strain-wave gears all repeat with the turn of the joint. There are many
    harmonics, so each is held near zero at its usual size; what the visited range does not tell stays there.
    """

    name: ClassVar[str] = "joint-error-map"
    stage: ClassVar[Stage] = "drive"
    mechanisms: ClassVar[tuple[str, ...]] = ("serial",)
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "cosine", "rad", 1e-4, "part in phase with zero, harmonics from the first", True, SLOW, held=True,
            bands=BANDS,
        ),
        Parameter(
            "sine", "rad", 1e-4, "part a quarter turn later, harmonics from the first", True, SLOW, held=True,
            bands=BANDS,
        ),
        Parameter(
            "fast_cosine", "rad", 2e-5, "the same of the harmonics above those", True, FAST, held=True,
            bands=(3,) * FAST,
        ),
        Parameter(
            "fast_sine", "rad", 2e-5, "the same of the harmonics above those", True, FAST, held=True,
            bands=(3,) * FAST,
        ),
    )  # fmt: skip
    card: ClassVar[Card] = Card(
        cause="The encoder ring or the strain-wave gear of a joint is uneven, so the joint errs alike at every turn.",
        equation="dq_i = sum over m = 1..64 of a_im cos(m q_i) + b_im sin(m q_i), each amplitude held near zero",
        source=(
            "positioning error of a rotary axis: ISO 230-2; kinematic error of strain-wave gears: Ghorbel, Gandhi and "
            "Alpeter, J. Mechanical Design 123, 2001"
        ),
        size="100 urad a harmonic up to about the thirtieth",
        fingerprint="J e of a joint against its angle: one wavy curve, the same at every turn and in every pose.",
        confused_with=(
            ("once-per-rev", "its first harmonic alone: joint angles spread over the turn"),
            ("dh-offsets", "a link's first harmonic in a lone joint: poses that vary all joints"),
            ("axis-compliance", "follows load, not angle: repeat under another payload"),
        ),
        remedy="Calibrate the joint against a reference encoder, or command corrected joints.",
        needs=f"{ROWS_A_JOINT} poses a joint, spread over the joint angles",
        telling="b",
    )
    called: ClassVar[str] = "encoder or gear"

    def say(self, theta: Tensor, std: Tensor, view: View) -> tuple[ValuePhrase, ...]:
        """Extremes of each joint's error over the range that it covered, and where they are."""
        low, high = view.covered
        places = low + torch.linspace(0.0, 1.0, PLACES, dtype=theta.dtype)[:, None] * (high - low)
        return extremes(self, self.shift(theta, view.at(q=places)), places)

    def needs(self, view: View) -> str | None:
        """More coordinates than harmonics."""
        least = ROWS_A_JOINT * view.joints
        return None if view.rows >= least else f"at least {least} rows"

    def basis(self, view: View, shape: Mapping[str, Tensor]) -> Tensor:
        """Cosines and sines of the multiples of each joint's angle."""
        order = torch.arange(1, SLOW + FAST + 1, dtype=view.q.dtype)
        phase = view.q[..., None] * order  # shape: (n, k, m)
        cosine, sine = torch.cos(phase), torch.sin(phase)
        return per_joint(cosine[..., :SLOW], sine[..., :SLOW], cosine[..., SLOW:], sine[..., SLOW:])


def extremes(effect: Effect, shift: Tensor, places: Tensor) -> tuple[ValuePhrase, ...]:
    """Maximum and minimum of each joint's shift, in words.

    Args:
        effect: whose usual size ranks them.
        shift: (n, k) rad.
        places: joint values of the rows, (n, k) rad.

    Returns:
        The maximum of each joint where it is positive, and the minimum where it is negative.
    """
    parts = []
    for joint in range(shift.shape[1]):
        for row, right in ((int(shift[:, joint].argmax()), 1.0), (int(shift[:, joint].argmin()), -1.0)):
            if right * float(shift[row, joint]) > 0.0:
                where = f"at q = {float(torch.rad2deg(places[row, joint])):z.0f} deg"
                ahead, behind = (f"run{{s}} up to {{what}} {side} {where}" for side in ("ahead", "behind"))
                value, usual = float(shift[row, joint]), effect.parameters[0].usual
                parts.append(said(Phrase("", ahead, behind), value, float("nan"), "rad", usual, joint + 1))
    return tuple(parts)
