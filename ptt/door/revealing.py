"""What was hidden in a sealed machine, and what a model makes of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ptt.challenge.challenge import Sealed, open_challenge
from ptt.challenge.score import Score, score
from ptt.challenge.truth import find_truth
from ptt.door.model import Model
from ptt.door.result import Result
from ptt.run.axes import AXES_TOTAL


@dataclass(frozen=True, eq=False, repr=False)
class Revealed(Result):
    """An opened challenge.

    Attributes:
        sealed: the hidden faults.
        score: the model compared with them, and the true tool error with its commands.
    """

    sealed: Sealed
    score: Score

    def _figures(self) -> Mapping[str, Any]:
        return {"level": self.sealed.level, "protocol": self.sealed.drawn.protocol, **self.score.to_dict()}

    def __str__(self) -> str:
        """What the command prints."""
        return _text(self.to_dict())


def reveal(model: Model, folder: str | Path) -> Revealed:
    """Open the seal of a challenge.

    Args:
        model: what was found.
        folder: of the challenge.

    Returns:
        What was hidden, beside what the model says.

    Raises:
        InputError: no challenge, or a broken seal.
    """
    sealed = open_challenge(folder)
    truth = find_truth(sealed.drawn, model.library)
    return Revealed(sealed, score(model.physics, truth, model.compensator.network_parts()[0]))


def _text(data: dict[str, Any]) -> str:
    noise = data["noise_um"]["total"]
    lines = [f"hidden ({data['level']}, measured as {data['protocol']}); noise of one reading {noise:.1f} um"]
    if not data["hidden"]:
        lines.append("  nothing")
    for item in data["hidden"]:
        lines += _hidden(item, noise)
    lines += [f"  {item['effect']}: {_WORDS[item['is']]}" for item in data["named"] if item["is"] != "right"]
    lines.append(f"the model's effects leave {data['left_um']:.1f} um of the run without noise")
    lines += _tool(data["tool_error_um"], noise)
    if data["worse"]:
        lines.append("the model's commands make the machine worse: look for a wrong sign in what it was fitted to")
    lines.append("RIGHT" if data["right"] else "NOT RIGHT")
    return "\n".join(lines)


_WORDS = {
    "fair": "fair: this run cannot tell it from what is hidden",
    "partial": "helps, but is not what is hidden",
    "unclaimed": "not said to be there: none of its values is measured as other than zero",
    "wrong": "WRONG, nothing of the kind is hidden",
}


def _hidden(item: dict[str, Any], noise: float) -> list[str]:
    status = item["is"].upper() if item["is"] == "missed" else item["is"]
    if item["instead"]:
        status += f" by {', '.join(item['instead'])}"
    elif item["is"] == "explained":
        status += " by the other effects of the model"
    size = item["size_um"]
    lines = [f"  {item['effect']}: {status}; alone it causes {size:.1f} um, {size / noise:.1f} x noise"]
    lines.append(f"    truth  {', '.join(f'{key} = {_short(value)}' for key, value in item['truth'].items())}")
    if item["model"]:
        lines.append(f"    model  {', '.join(_parameter(one) for one in item['model'])}")
    return lines


def _parameter(one: dict[str, Any]) -> str:
    std = "" if one["std"] is None else f" +- {one['std']:.2g}"
    return f"{one['name']} = {one['value']:.4g}{std}"


def _short(value: Any) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(_short(item) for item in value)}]"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _tool(error: dict[str, dict[str, float] | None], noise: float) -> list[str]:
    """True error before and after, re-measured."""
    lines = ["true tool error, re-measured on the machine without noise after the best rigid motion, rms in um:"]
    for word, row in error.items():
        if row is None:
            lines.append(f"  {word:<7}the machine cannot follow the model's commands")
        else:
            figures = "  ".join(f"{axis} {row[axis]:.1f}" for axis in AXES_TOTAL)
            lines.append(f"  {word:<7}{figures}  ({row['total'] / noise:.2f} x noise)")
    return lines
