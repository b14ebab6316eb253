"""`ptt --version`: versions of the program and of what its figures come from."""

import platform
import sys

from ptt.version import __version__, installed

PACKAGES = ("torch", "numpy", "scipy", "pandas", "pydantic", "safetensors", "tomlkit", "typer", "matplotlib", "nicegui")


def versions() -> dict[str, str | None]:
    """Versions by name, None for a package that is not there; nothing heavy is imported."""
    own = {"ptt": __version__, "python": platform.python_version()}
    return {**own, **installed(PACKAGES), "platform": f"{sys.platform} {platform.machine()}"}


def text_of(found: dict[str, str | None]) -> str:
    """The same, one a line, those that are there."""
    return "\n".join(f"{name} {number}" for name, number in found.items() if number)
