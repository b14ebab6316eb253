"""The head of every exported file: its model, the runs it was fitted to, and the date."""

from pathlib import Path
from typing import TYPE_CHECKING

from ptt.correct.exports.format import Options
from ptt.files import sha256
from ptt.version import __version__

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator


def head_lines(compensator: "Compensator", options: Options) -> list[str]:
    """Model, run, date and SHA-256, one line each, without comment signs.

    Args:
        compensator: what is exported.
        options: where it came from.

    Returns:
        Lines of printable ASCII, so that any controller takes them in a comment.
    """
    file = compensator.model.file
    lines = [f"{file.machine.name} ({file.machine.kind}), exported by ptt {__version__} on {options.date.isoformat()}"]
    lines += [f"model {path.name}, SHA-256 {sha256(path)}" for path in _files(options.model_path)]
    for step in reversed(file.steps):
        runs = [item for item in step.get("files", ()) if item.get("sha256")]
        lines += [f"run {Path(str(item.get('file', 'run'))).name}, SHA-256 {item['sha256']}" for item in runs]
        if runs:
            break
    return [_plain(line) for line in lines]


def _files(path: Path | None) -> list[Path]:
    """The files that a model consists of."""
    if path is None:
        return []
    if path.is_dir():
        return [each for each in (path / "model.toml", path / "rbf.safetensors") if each.is_file()]
    return [path]


def _plain(text: str) -> str:
    """Printable ASCII without anything that could end a comment."""
    plain = "".join(c if " " <= c <= "~" else "?" for c in text)
    return plain.replace("*/", "* /").replace("/*", "/ *").replace(")", "]").replace("(", "[").replace("\\", "/")
