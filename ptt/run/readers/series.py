"""Columns whose titles number the joints; they are commands only where no other columns are."""

import re
from collections import Counter
from dataclasses import replace

from ptt.run.readers.columns import Meaning, split_joint
from ptt.run.readers.titles import meaning_of, normalise

SLIDERS, LEAST_JOINTS = 3, 3  # of a 3-PTT; of an arm that is not known
_PIN = re.compile(r"((?:joint|axis)\.)(\d+)(\..+)")  # a HAL pin of LinuxCNC: joint.0.pos-cmd


def counted_from_zero(titles: tuple[str, ...], meanings: list[Meaning | None]) -> list[Meaning | None]:
    """The pins of LinuxCNC count from 0: beside a `joint.0.pos-cmd`, joint.1 is the second.

    Args:
        titles: one per column.
        meanings: what each says by itself.

    Returns:
        The meanings, with those of such pins.
    """
    pins = [_PIN.fullmatch(normalise(title)) for title in titles]
    zero = {pin[1] for pin in pins if pin and int(pin[2]) == 0}
    return [
        meaning_of(f"{pin[1]}{int(pin[2]) + 1}{pin[3]}") if pin and pin[1] in zero else meaning
        for pin, meaning in zip(pins, meanings, strict=True)
    ]


def settle_likely(meanings: list[Meaning | None], joints: int | None, letter: str) -> list[Meaning | None]:
    """Accept likely meanings where no other column has them; commands only where each joint has one.

    Args:
        meanings: what each column holds.
        joints: number k of joints of the machine; None where it is not known.
        letter: 'b' or 'q' of its joints.

    Returns:
        The meanings; each likely one is accepted (no longer likely) or None.
    """
    sure = {meaning.quantity.replace("_bare", "_cmd") for meaning in meanings if meaning and not meaning.likely}
    likely = [meaning for meaning in meanings if meaning and meaning.likely]
    counts = Counter(meaning.quantity for meaning in likely)
    commands = set() if any(map(split_joint, sure)) else _whole_series(likely, joints, letter)
    taken = commands | {name for name, count in counts.items() if not split_joint(name) and count == 1} - sure
    return [_settled(meaning, taken) if meaning and meaning.likely else meaning for meaning in meanings]


def _settled(meaning: Meaning, taken: set[str]) -> Meaning | None:
    return replace(meaning, likely=False) if meaning.quantity in taken else None


def _whole_series(likely: list[Meaning], joints: int | None, letter: str) -> set[str]:
    """Commands of the joints 1 to k, where there is one of each; of a machine that is not known, as many as count on.

    A 3-PTT has no angles, but an axis without a unit may slide.
    """
    unstated = [meaning for meaning in likely if meaning.unit is None]
    for each, some in (("b", likely), ("q", unstated if joints and letter == "b" else likely)):
        numbers = {joint[1] for joint in map(split_joint, (one.quantity for one in some)) if joint and joint[0] == each}
        if joints and letter == "q" and each == "b":
            continue
        counted = joints or (SLIDERS if each == "b" else max(len(numbers), LEAST_JOINTS))
        if numbers >= set(range(1, counted + 1)) and (joints or len(numbers) == counted):
            return {f"{each}{number}_cmd" for number in range(1, counted + 1)}
    return set()
