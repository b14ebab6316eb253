"""Translation of a report by a file of phrases for each language; a sentence that they do not cover stays English.

The file is a context-free grammar with translations. Each of its tables is one kind of phrase (a non-terminal), and a
gap in a phrase is named by the kind that may fill it: '{side}' by phrases of the table 'side', `{}`, `{what}` and
`{axis}` by numbers with their units, '{name}' by names of effects, '{any}' by any text, such as a file's name. A list
is recursive: '{part} and {clause}' is one phrase and the rest of the list. Verb endings are written as in the phrases
of effects, whose words are in the tables 'side' and 'cure'.
"""

import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

from ptt.effects.phrases import MANY, ONE
from ptt.errors import InputError

Say = Callable[[str], str]
ROOM = files("ptt.show.report").joinpath("languages")
GAP = re.compile(r"{(\w*)}")
VERB = re.compile("{(" + "|".join(ONE) + ")}")  # ending of a verb, as in the phrases of effects
FIGURE_GAPS, ANY = ("", "what", "axis"), "any"
UNIT = r"(?:[nmuk\N{MICRO SIGN}]?(?:m|rad|g|s|N)|deg|min|days|[hKCxyz])"
FIGURES = re.compile(rf"(?:\b(?:{UNIT}|to|and|more)\b|\d[\d.]*e[+-]?\d+|[\d⁰¹²³⁴⁵⁶⁷⁸⁹]|[^\w;:])+")
NAME = re.compile(r"[\w.-]+(\[[^\]]*\])?")
SENTENCE = re.compile(r"(?<=[\w)%\]]\.)\s(?=\(?[A-Z`])")  # space between two sentences
STOP = ". "  # key of the sign that ends a sentence


@dataclass(frozen=True)
class Template:
    """A phrase with gaps.

    Attributes:
        pieces: literal pieces of the English phrase around the gaps, one more than there are gaps.
        kinds: kind of phrase that may fill each gap.
        value: the phrase in the other language, a format string with as many gaps.
    """

    pieces: tuple[str, ...]
    kinds: tuple[str, ...]
    value: str


def languages() -> tuple[str, ...]:
    """Languages that have a file of words, English first."""
    return ("en", *sorted(path.name.removesuffix(".toml") for path in ROOM.iterdir() if path.name.endswith(".toml")))


def phrases_of(language: str) -> dict[str, dict[str, str]]:
    """The file of words of a language: kind of phrase -> English -> the same in it."""
    return tomllib.loads(ROOM.joinpath(f"{language}.toml").read_text(encoding="utf-8"))


def words_of(language: str) -> Say:
    """A function that translates a text as a whole or sentence by sentence; unknown sentences stay as they are.

    Args:
        language: one of `languages`, such as 'en' or 'zh'.

    Returns:
        The function.

    Raises:
        InputError: there is no file of words for it.
    """
    if language == "en":
        return str
    if language not in languages():
        raise InputError(f"no words for '{language}'", where="--language", fix=f"take one of {', '.join(languages())}")
    tables = phrases_of(language)
    templates = {kind: _templates(table) for kind, table in tables.items()}
    stop = tables["words"][STOP]

    def known(text: str) -> str | None:
        said = (told(text, kind) for kind in ("words", "", "name"))
        return next((words for words in said if words is not None), None)

    @lru_cache(maxsize=65536)
    def told(text: str, kind: str) -> str | None:
        """Translation of a text as one kind of phrase; None where it is none of that kind."""
        if kind in FIGURE_GAPS:
            return _figures(text, tables["figures"])
        if kind == ANY:
            return known(text) or text
        for words in dict.fromkeys((text, f"{text[:1].lower()}{text[1:]}")):
            if words in tables[kind]:
                return tables[kind][words]
            for template in templates[kind]:
                for gaps in _fillings(template.pieces, words):
                    parts = list(zip(gaps, template.kinds, strict=True))
                    # Gaps for any text are left to the end, because they search all phrases.
                    if all(told(*part) is not None for part in parts if part[1] != ANY):
                        return template.value.format(*(told(*part) for part in parts))
        return text if kind == "name" and NAME.fullmatch(text) else None

    def sentence(text: str) -> str:
        ended = text.endswith(".")
        said = known(text.removesuffix("."))
        if said is None:
            return f"{text} " if ended else text
        return f"{said.strip()}{stop}" if ended else said.strip()

    def say(text: str) -> str:
        text = text.replace("\N{NO-BREAK SPACE}", " ")
        if (whole := tables["words"].get(text.removesuffix("."))) is not None:
            return f"{whole}{stop}" if text.endswith(".") else whole
        return "".join(map(sentence, SENTENCE.split(text))).rstrip()

    return say


def _templates(table: dict[str, str]) -> list[Template]:
    """The phrases of a table that have gaps; one with verb endings gives a singular and a plural template."""
    forms = {inflected(key, form): value for key, value in table.items() for form in (ONE, MANY)}
    split = [(GAP.split(key), value) for key, value in forms.items()]
    return [Template(tuple(parts[::2]), tuple(parts[1::2]), value) for parts, value in split if len(parts) > 1]


def inflected(phrase: str, form: Mapping[str, str]) -> str:
    """A phrase with its verb endings filled in; `form` is `ptt.effects.phrases.ONE` or `MANY`."""
    return VERB.sub(lambda ending: form[ending[1]], phrase)


def _fillings(pieces: tuple[str, ...], text: str) -> Iterator[tuple[str, ...]]:
    """All ways to fill the gaps between two or more pieces, none left empty, so that a text results."""
    if not text.startswith(pieces[0]):
        return
    rest = text[len(pieces[0]) :]
    if len(pieces) == 2:
        if rest.endswith(pieces[1]) and len(rest) > len(pieces[1]):
            yield (rest.removesuffix(pieces[1]),)
        return
    at = rest.find(pieces[1], 1)
    while at > 0:
        for more in _fillings(pieces[1:], rest[at:]):
            yield (rest[:at], *more)
        at = rest.find(pieces[1], at + 1)


def _figures(text: str, joints: dict[str, str]) -> str | None:
    """Numbers with units, their joining words translated; None for a text that has other words."""
    if not FIGURES.fullmatch(text):
        return None
    for english, other in joints.items():
        text = text.replace(english, other)
    return text
