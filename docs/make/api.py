"""Write docs/api.md from the docstrings of the front door: `python docs/make/api.py`. No code is run."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
BOOK = ROOT / "docs" / "api.md"
ORDER = (
    "load", "read", "read_targets", "check", "compare", "diagnose", "add", "remove", "fit", "train", "predict",
    "evaluate", "recheck", "export", "simulate", "Model", "Run",
)  # fmt: skip
HEAD = """# API

What `import ptt` gives. Every result has `to_dict()`, `str()`, `plot()` and, where it is a table, `to_frame()`;
[library.md](library.md) shows them at work, [effects.md](effects.md) has the effects. Lengths are mm, angles rad,
times s, temperatures C, masses kg, forces N.

This page is written from the docstrings by `make docs`.
"""


def book() -> str:
    """The whole page."""
    homes = _homes()
    parts = [HEAD]
    for name in ORDER:
        tree = ast.parse((ROOT / "ptt" / "door" / f"{homes[name]}.py").read_text(encoding="utf-8"))
        node = next(each for each in tree.body if getattr(each, "name", "") == name)
        if isinstance(node, ast.ClassDef):
            parts.append(_class(node, tree))
            continue
        parts.append(_function(node, name))
        made = [name for name in _made(node) if name not in ("Model", "Run")]
        results = [each for each in tree.body if isinstance(each, ast.ClassDef) and each.name in made]
        parts += [_members(each, f"`{each.name}`: {_first(each)}") for each in results]
    return "\n".join(parts)


def _homes() -> dict[str, str]:
    """Name -> file of the front door, as ptt/__init__.py has it."""
    tree = ast.parse((ROOT / "ptt" / "__init__.py").read_text(encoding="utf-8"))
    found = next(
        each.value for each in tree.body
        if isinstance(each, ast.Assign) and getattr(each.targets[0], "id", "") == "_DOOR"
    )  # fmt: skip
    return {**ast.literal_eval(found)}


def _function(node: ast.stmt, name: str) -> str:
    assert isinstance(node, ast.FunctionDef)
    return f"## ptt.{name}\n\n```python\nptt.{name}({_signature(node.args)})\n```\n\n{_text(node)}\n"


def _class(node: ast.ClassDef, tree: ast.Module) -> str:
    bases = {base.id for base in node.bases if isinstance(base, ast.Name)}
    above = [each for each in tree.body if isinstance(each, ast.ClassDef) and each.name in bases]
    body = "\n".join(_members(each, "") for each in (node, *above))
    return f"## ptt.{node.name}\n\n{_text(node)}\n\n{body}"


def _members(node: ast.ClassDef, title: str) -> str:
    lines = [title, ""] if title else []
    for each in node.body:
        if isinstance(each, ast.FunctionDef) and not each.name.startswith("_"):
            value = any(isinstance(d, ast.Name) and "property" in d.id for d in each.decorator_list)
            call = "" if value else f"({_signature(each.args)})"
            lines.append(f"- `.{each.name}{call}`: {_first(each)}")
    return "\n".join(lines) + "\n"


def _made(node: ast.stmt) -> list[str]:
    """Names of what a function hands back."""
    assert isinstance(node, ast.FunctionDef)
    return [] if node.returns is None else [name.strip("'\"") for name in ast.unparse(node.returns).split(" | ")]


def _signature(given: ast.arguments) -> str:
    shown = ast.unparse(given)
    shown = re.sub(r", (progress|note): \w+ ?= ?\w+", "", shown).replace("self, ", "")
    return "" if shown == "self" else shown


def _first(node: ast.ClassDef | ast.FunctionDef) -> str:
    return (ast.get_docstring(node) or "").split("\n")[0]


def _text(node: ast.ClassDef | ast.FunctionDef) -> str:
    """The docstring as Markdown: sections as bold words, entries as lists."""
    lines = []
    for line in (ast.get_docstring(node) or "").splitlines():
        if re.fullmatch(r"(Args|Returns|Raises|Attributes|Yields):", line):
            lines += [f"**{line[:-1]}**", ""]
        elif entry := re.fullmatch(r"    (\*?\w+): (.*)", line):
            if entry[1] not in ("progress", "note"):
                lines.append(f"- `{entry[1]}`: {entry[2]}")
            else:
                lines.append(f"- `{entry[1]}`: called while it works; {entry[2]}")
        else:
            lines.append(f"  {line.strip()}" if line.startswith("        ") else line.strip())
    return "\n".join(lines)


def main() -> None:
    """Write the page."""
    BOOK.write_text(book(), encoding="utf-8")


if __name__ == "__main__":
    main()
