"""Units as a page has them: one name for each, in questions, on chips and in tables."""

from ptt.run.readers.columns import UNITS

WORDS = {"c": "\N{DEGREE SIGN}C", "k": "K", "f": "\N{DEGREE SIGN}F", "stamp": "date and time"}


def unit_in_words(choice: str) -> str:
    """A unit as a chip has it; what is no unit stays as it is."""
    if not any(choice in units for units in UNITS.values()):
        return choice
    return WORDS.get(choice, choice.replace("um", "\N{MICRO SIGN}m").replace("_", "/"))
