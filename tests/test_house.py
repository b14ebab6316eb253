"""The house of files: what the layers of import-linter do not see, since they look at rooms."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import grimp
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

ROOT = Path(__file__).resolve().parents[1]


def test_no_file_needs_itself_through_others() -> None:
    graph = grimp.build_graph("ptt", "nets")
    files = sorted(name for name in graph.modules if not graph.find_children(name))
    place = {name: number for number, name in enumerate(files)}
    pairs = [
        (place[name], place[to])
        for name in files
        for to in graph.find_modules_directly_imported_by(name)
        if to in place
    ]
    from_, to = np.array(pairs).T
    whole = coo_array((np.ones(len(pairs)), (from_, to)), shape=(len(files),) * 2)
    _, ring = connected_components(whole, directed=True, connection="strong")
    shared = [[files[i] for i in np.flatnonzero(ring == r)] for r in np.flatnonzero(np.bincount(ring) > 1)]
    assert len(pairs) > 1000 and shared == []


def taken(script: Path) -> Iterator[tuple[str, str]]:
    """What a script takes from the packages: (room, name)."""
    for node in ast.walk(ast.parse(script.read_text())):
        if (
            isinstance(node, ast.ImportFrom)
            and node.module
            and node.module.split(".")[0] in ("ptt", "nets", "benchmarks")
        ):
            yield from ((node.module, alias.name) for alias in node.names)


def holds(room: str, name: str) -> bool:
    """Whether a room has a name, as its source says."""
    place = ROOT.joinpath(*room.split("."))
    if (place / f"{name}.py").exists() or (place / name / "__init__.py").exists():
        return True
    file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    if not file.exists():
        return place.is_dir() and (place / name).exists()
    return name in named(file) or f'"{name}"' in file.read_text()


@cache
def named(file: Path) -> set[str]:
    """Every name that a file defines, imports or assigns."""
    nodes = ast.walk(ast.parse(file.read_text()))
    return {str(getattr(node, key, None)) for node in nodes for key in ("name", "asname", "id")}


def test_scripts_take_only_names_that_are_there() -> None:
    """No package imports the demo, the benchmarks and the makers of data and docs, so nothing else sees them break."""
    scripts = [*ROOT.glob("data/*.py"), *ROOT.glob("docs/**/*.py"), *ROOT.glob("benchmarks/**/*.py"), ROOT / "train.py"]
    lost = [(script.name, *what) for script in scripts for what in taken(script) if not holds(*what)]
    assert len(scripts) > 20 and lost == []
    assert not holds("ptt.diagnosis.evidence.noise_level", "noise_floor")
