"""G- and M-codes: which are known, which are refused, which use axis words for something else than a target.

G-codes and M-codes here are those of RS274/NGC and LinuxCNC, and what Marlin and RepRapFirmware add to them.
"""

from ptt.correct.program.words import EXPAND, ProgramBlock, at_line
from ptt.errors import InputError

TOOL_AXES, FURTHER_AXES = "XYZ", "ABCUVWE"
# Codes are ten times their numbers, as G59.1 needs a tenth; M-codes that `own_words` looks at are plain numbers.
MM = {200: 25.4, 210: 1.0}
MOTIONS = (0, 10, 20, 30)  # G0 to G3
NO_MOTION = -1
SYSTEMS = (540, 550, 560, 570, 580, 590, 591, 592, 593)  # G54 to G59.3, work coordinate systems
# What a G-code changes of the modal state (`ptt.correct.program.modal.ModalState`), and to what.
MODES: dict[int, tuple[str, object]] = {
    **{code: ("motion", code) for code in MOTIONS},
    800: ("motion", NO_MOTION),
    900: ("absolute", True),
    910: ("absolute", False),
    901: ("centre_absolute", True),
    911: ("centre_absolute", False),
    170: ("plane", 17),
    180: ("plane", 18),
    190: ("plane", 19),
    **{code: ("unit", unit) for code, unit in MM.items()},
    **{code: ("system", code) for code in SYSTEMS},
}
EXTRUDER_RELATIVE = {820: False, 830: True}  # M82, M83
PROBES = (290, 320)  # of printers; with axis words they are other codes on other controllers
HOME = (280, 300, *PROBES)  # the position after these is unknown
OWN_AXES = (40, *HOME, 920)  # codes whose axis words are not a target
LENGTHS = (430, 431, 432, 490)  # G43, G43.1, G43.2, G49: tool length offsets
# Codes that do not move the tool or redefine positions in a way unknown here; any code in no list is refused.
HARMLESS = (
    80, 90, 170, 180, 190, *MM, 400, *LENGTHS, 530, *SYSTEMS, 610, 611, 640, 800, 900, 901, 910, 911, 940, 960, 970,
    980, 990,
)  # fmt: skip
# Harmless only without axis words: cancel codes of a preamble, and stored positions.
ALONE = (110, 131, 150, 220, 230, 250, 281, 301, 401, 500, 501, 620, 670, 690, 921)
RETRACT = 100  # G10 without axis words or L: a printer's retraction; else it sets offsets
REFUSED = {
    50: "a spline", 51: "a spline", 52: "a spline", 53: "a spline",
    70: "diameters for X", RETRACT: "a change of offsets", 160: "polar coordinates",
    330: "a thread", 331: "a tapping cycle",
    382: "a probing move", 383: "a probing move", 384: "a probing move", 385: "a probing move",
    410: "cutter compensation", 411: "cutter compensation", 420: "cutter compensation", 421: "cutter compensation",
    510: "scaling", 520: "a move of the origin", 680: "a turn of the coordinates", 730: "a canned cycle",
    740: "a canned cycle", 760: "a threading cycle", 930: "inverse time feed", 950: "feed per turn of the spindle",
    **{code: "a canned cycle" for code in range(810, 900, 10)},
}  # fmt: skip
CALLS = (970, 980, 990)  # M97, M98, M99
# M-codes that do not use axis words, which are then a move: those of RS274, and clamps.
BESIDE_MOVES = (*range(0, 17), 19, 30, *range(48, 54), *range(60, 67))
# Settings of motors, speeds, limits and outputs, which do not change positions.
SETTINGS = (
    17, 18, 67, 68, 84, 125, 201, 202, 203, 204, 205, 208, 211, 350,
    425, 566, 569, 584, 593, 600, 851, 906, 907, 911, 913, 914, 915, 916, 917,
)  # fmt: skip
MOVES_ORIGIN = (92, 206, 218, 290, 428, 579, 665, 666, 669)  # counts per mm, offsets, the controller's own geometry


def refuse(block: ProgramBlock, codes: list[int], source: str) -> None:
    """Refuse a block whose effect on moves only the controller knows.

    Args:
        block: the line.
        codes: its G-codes, ten times their numbers.
        source: file name for messages.

    Raises:
        InputError: it is one.
    """
    where = at_line(source, block.line)
    for code in codes:
        if code == RETRACT and not any(word.letter in ("L", *TOOL_AXES) for word in block.words):
            continue
        if code in REFUSED:
            raise InputError(f"G{code / 10:g}, {REFUSED[code]}, cannot be corrected", where=where, fix=EXPAND)
        placed = any(word.letter in TOOL_AXES + FURTHER_AXES for word in block.words)
        if code in PROBES and any(other in MOTIONS for other in codes):
            raise InputError(f"G{code / 10:g} and a move in one line", where=where, fix="split the line")
        if code in (*ALONE, *PROBES) and placed:
            raise InputError(f"axis words beside G{code / 10:g}", where=where, fix="split the line")
        if code not in (*MOTIONS, *OWN_AXES, *HARMLESS, *ALONE):
            what = f"what G{code / 10:g} does is not known" if code >= 0 else "G without a number"
            raise InputError(f"{what}: it may move the tool, or what moves after it", where=where, fix=EXPAND)
    calls = [word for word in block.words if word.letter == "O" or (word.letter == "M" and word.code in CALLS)]
    if any(not (word.letter == "O" and block.words[0] is word and len(block.words) == 1) for word in calls):
        raise InputError(f"{calls[0].text}: a subprogram is run only by the controller", where=where, fix=EXPAND)
    if sum(code in MOTIONS for code in codes) > 1:
        raise InputError("two kinds of moves in one line", where=where, fix="split the line")
    _refuse_settings(block, codes, where)


def _refuse_settings(block: ProgramBlock, codes: list[int], where: str) -> None:
    """Refuse M-codes that change the origin or scale of positions, or whose axis words are not known."""
    letters = {word.letter for word in block.words} & set(TOOL_AXES + FURTHER_AXES)
    for number in own_words(block):
        asks = number != 428 and not any(word.letter not in "NM" for word in block.words)  # alone it only reports
        if number in MOVES_ORIGIN and letters != {"E"} and not asks:
            what = f"M{number} changes how the controller takes positions"
            raise InputError(what, where=where, fix="take it out, and set it in the controller before the run")
        moves = any(code in MOTIONS for code in codes)
        if letters and moves and number in (*SETTINGS, *MOVES_ORIGIN):
            raise InputError(f"M{number} and a move in one line", where=where, fix="split the line")
        if letters and not moves and number not in (*SETTINGS, *MOVES_ORIGIN):
            what = f"what M{number} does with {', '.join(sorted(letters))} is not known"
            raise InputError(what, where=where, fix="take it out, or state G0 or G1 in this line if it is a move")


def own_words(block: ProgramBlock) -> list[int]:
    """Numbers of a block's M-codes that may use axis words themselves."""
    numbers = [word.code // 10 for word in block.words if word.letter == "M"]
    return [number for number in numbers if number not in BESIDE_MOVES]
