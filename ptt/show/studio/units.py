"""Names of units for the page."""

from ptt.run.readers.columns import UNITS

WORDS = {
    "c": "\N{DEGREE SIGN}C", "k": "K", "f": "\N{DEGREE SIGN}F", "stamp": "date and time",
    "n": "N", "nm": "N m", "kn": "kN", "knm": "kN m", "ncm": "N cm", "nmm": "N mm",
}  # fmt: skip


def unit_in_words(choice: str) -> str:
    """A unit of a mapping file as the page writes it; any other text stays as it is."""
    if not any(choice in units for units in UNITS.values()):
        return choice
    return WORDS.get(choice, choice.replace("um", "\N{MICRO SIGN}m").replace("_", "/"))
