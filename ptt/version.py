"""Versions of the program, where every room can read it, and of what its figures come from."""

import platform
import sys
from collections.abc import Iterable

__version__ = "0.1.0"
PACKAGES = ("torch", "numpy", "scipy", "pandas", "pydantic", "safetensors", "tomlkit", "typer", "matplotlib", "nicegui")


def versions() -> dict[str, str | None]:
    """What `ptt --version` says, by name; None for a package that is not there; nothing heavy is imported."""
    own = {"ptt": __version__, "python": platform.python_version()}
    return {**own, **installed(PACKAGES), "platform": f"{sys.platform} {platform.machine()}"}


def text_of(found: dict[str, str | None]) -> str:
    """Versions, one a line, those that are there."""
    return "\n".join(f"{name} {number}" for name, number in found.items() if number)


def installed(names: Iterable[str]) -> dict[str, str | None]:
    """Versions of packages by name; None for one that is not there."""
    from importlib.metadata import PackageNotFoundError, version

    found: dict[str, str | None] = {}
    for name in names:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = None
    return found
