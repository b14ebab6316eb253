"""Words of a report in another language: one file of phrases; what it does not have stays English."""

import re
import tomllib
from collections.abc import Callable
from functools import lru_cache
from importlib.resources import files

from ptt.errors import InputError

Say = Callable[[str], str]
ROOM = files("ptt.show.report").joinpath("languages")
NUMBERS = re.compile(r"[\d.]+(, [\d.]+)* and [\d.]+(\s\S+)?")  # '1, 2 and 3', '55, 16 and 43 um'
GAP = re.compile(r"\\{(\d*)\\}")  # as re.escape writes a gap


def languages() -> tuple[str, ...]:
    """Languages that have a file of words, English first."""
    return ("en", *sorted(path.name.removesuffix(".toml") for path in ROOM.iterdir() if path.name.endswith(".toml")))


def words_of(language: str) -> Say:
    """What says a phrase in a language.

    A phrase is looked up whole, then as one with gaps ('Error of {} readings, um'), whose parts are said in turn, then
    sentence by sentence.

    Args:
        language: 'en', 'zh'.

    Returns:
        The function.

    Raises:
        InputError: there is no file of words for it.
    """
    if language == "en":
        return str
    if language not in languages():
        raise InputError(f"no words for '{language}'", where="--language", fix=f"take one of {', '.join(languages())}")
    data = tomllib.loads(ROOM.joinpath(f"{language}.toml").read_text(encoding="utf-8"))["words"]
    whole = {key: value for key, value in data.items() if "{" not in key}
    gaps = [(re.compile(GAP.sub("(.+?)", re.escape(key))), value) for key, value in data.items() if "{" in key]
    stop = "\u3002" if language == "zh" else ". "

    @lru_cache(maxsize=4096)
    def say(text: str) -> str:
        if text in whole:
            return str(whole[text])
        if NUMBERS.fullmatch(text):
            return text.replace(", ", whole.get(", ", ", ")).replace(" and ", whole.get(" and ", " and "))
        for pattern, value in gaps:
            if found := pattern.fullmatch(text):
                return str(value).format(*map(say, found.groups()))
        parts = re.split(r"(?<=[a-z0-9)%])[.] (?=[A-Z])", text)
        if len(parts) == 1:
            return text
        said = [_sentence(say, part) for part in parts]
        known = all(new != old for new, old in zip(said, parts, strict=True))
        return (stop if known else ". ").join(said)

    return say


def _sentence(say: Say, part: str) -> str:
    """One of several sentences, its full stop lost unless it is the last: with the stop where only that is known."""
    said = say(part)
    return say(f"{part}.").rstrip(".\u3002") if said == part and not part.endswith(".") else said
