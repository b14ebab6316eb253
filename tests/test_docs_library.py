"""docs/library.py runs, is short, and docs/library.md and docs/api.md are what `make docs` would write."""

import importlib.util
import os
import re
from pathlib import Path
from types import ModuleType

import ptt

ROOT = Path(__file__).resolve().parents[1]


def maker(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"make_{name}", ROOT / "docs" / "make" / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_loop_of_the_docs_runs_and_is_short(tmp_path, monkeypatch):
    code = (ROOT / "docs" / "library.py").read_text()
    assert len([line for line in code.splitlines() if line.strip() and not line.startswith("#")]) <= 15
    (tmp_path / "data").symlink_to(ROOT / "data")
    monkeypatch.chdir(tmp_path)
    written = maker("library").book()
    assert (tmp_path / "sliders.csv").exists() and ptt.load("solved.toml").effects == ("backlash",)
    told = (ROOT / "docs" / "library.md").read_text()
    digits = re.compile(r"-?\d+\.?\d*(e-?\d+)?")
    assert digits.sub("#", written) == digits.sub("#", told), "run `make docs`"
    assert os.getcwd() == str(tmp_path)


def test_the_api_page_is_up_to_date():
    page = maker("api").book()
    assert page == (ROOT / "docs" / "api.md").read_text(), "run `make docs`"
    assert all(f"## ptt.{name}\n" in page for name in ptt.__all__ if name != "effects")
