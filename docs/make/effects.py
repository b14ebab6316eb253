"""Write docs/effects.md from the classes of the library: `python docs/make/effects.py`."""

from pathlib import Path

from ptt.effects import STAGES, Effect, library
from ptt.effects.cards import card_of
from ptt.effects.parameter import Parameter

BOOK = Path(__file__).parents[1] / "effects.md"
HEAD = """# Effects

What the library knows, stage by stage of the causal chain: target -> joint command -> **drive** -> joint value ->
**geometry** -> tool -> **structure** -> tool -> **metrology** -> reading. Every effect adds a shift at its stage; zero
parameters are the drawing. `ptt effects NAME --plot DIR` draws one, `ptt effects new NAME` begins one of your own.

This page is written from the classes in `ptt/effects` by `make docs`.
"""


def book() -> str:
    """The whole page."""
    known = library()
    parts = [HEAD]
    for stage in STAGES:
        parts.append(f"## {stage.capitalize()}\n")
        parts += [_chapter(cls) for cls in known.values() if cls.stage == stage]
    return "\n".join(parts)


def _chapter(cls: type[Effect]) -> str:
    card, machines = card_of(cls), {"three-ptt": "3-PTT", "serial": "arms"}
    rows = [
        f"### {cls.name}\n",
        f"{card.cause}\n",
        f"- **Equation:** {_math(card.equation)}",
        f"- **Source:** {card.source}",
        f"- **On:** {', '.join(machines[kind] for kind in cls.mechanisms)}. **Needs:** {card.needs}",
        f"- **Usual size:** {card.size}{f'; on arms {card.arm_size}' if card.arm_size else ''}",
        f"- **Fingerprint:** {card.fingerprint}",
        *(f"- **Confused with** {what}: {separates}" for what, separates in card.confused_with),
        f"- **Remedy:** {card.remedy}\n",
        "| parameter | unit | usual | role | meaning |",
        "| --- | --- | --- | --- | --- |",
        *(_row(parameter.on(cls.mechanisms[0])) for parameter in cls.parameters),
    ]
    return "\n".join(rows) + "\n"


def _math(text: str) -> str:
    return text.replace("*", "\\*").replace("|", "\\|").replace("_", "\\_")


def _row(parameter: Parameter) -> str:
    return (
        f"| `{parameter.name}` | {parameter.unit} | {parameter.usual:g} | {parameter.role} | "
        f"{parameter.meaning.replace('|', chr(92) + '|')} |"
    )


if __name__ == "__main__":
    BOOK.write_text(book(), encoding="utf-8")
