"""Damage to the code of an effect of one's own."""

import random
from pathlib import Path

from fuzz_mutation import Mutation

MORE: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("def basis(", (
        "_seen = []\n    def basis(", "__slots__ = ()\n    def basis(", "def __init__(self, x): pass\n    def basis(",
        "def __eq__(self, other): 1 / 0\n    def basis(", "def __repr__(self): 1 / 0\n    def basis(",
        "def __getattr__(self, name): 1 / 0\n    def basis(", "@staticmethod\n    def basis(",
        "@classmethod\n    def basis(", "@property\n    def basis(", "label = 3\n    def basis(",
        "def __hash__(self): return None\n    def basis(", "key = 'backlash'\n    def basis(",
        "def shift(self, theta, view): return theta\n    def basis(", "words = 3\n    def basis(",
        "def describe(self, *_): raise ValueError\n    def basis(", "reverses = True\n    def basis(",
    )),
    ("return height", (
        "view.q.add_(1.0); return height", "return torch.rand(3, 2, 1)", "yield height", "return height.tolist()",
        "return torch.empty(10**13)", "import sys; print('x', file=sys.stderr); return height",
        "return torch.full((len(height), 3, 2), 1e300, dtype=torch.float64); height",
        "return (x for x in height); height", "raise KeyboardInterrupt if False else OSError(28, 'full'); height",
        "raise MemoryError; height", "import logging; logging.warning('look'); return height",
        "view.q = None; return height", "return torch.nn.Parameter(height)[..., None] * 0; height",
        "torch.manual_seed(0); return torch.rand(1) * height", "return height.half()",
        "raise ValueError('x' * 9000 + chr(10) + chr(0x202e)); height", "raise Exception; height",
    )),
)  # fmt: skip
OWN_CHANGES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ('name = "pull"', ('name = ""', "name = 3", 'name = "Pull Me"', "name = None", 'name = "backlash"',
    'name = "x" * 99999',
                       'name = ["pull"]', 'name = "pull\\n2"', "")),
    ('stage = "structure"', ('stage = "drive"', 'stage = "geometry"', "stage = 3",
    "stage = []", 'stage = "metrology"', "")),
    ('mechanisms = ("three-ptt",)', ("mechanisms = ()",
    "mechanisms = 3", 'mechanisms = "three-ptt"', "mechanisms = (3,)",
                                     "mechanisms = None", "")),
    ("count=2", ("count=0", "count=-1", "count=2.5", 'count="2"', "count=5", "count=10**9", "count=None",
    "per_joint=True")),
    ("1e-4", ("0.0", "-1.0", 'float("nan")', "1e308", "1e-320", '"a"', "None")),
    ('"pull", "1"', ('"", "1"', '3, "1"', '"pull", "furlong"', '"pull", 3', '"pu ll", "mm"', '"a.b", "mm"')),
    ("requires = ()", ('requires = ("moon",)', "requires = 3", 'requires = "time"', 'requires = ("time",)')),
    ("torch.eye(3, 2, dtype=torch.float64)", (
        "torch.eye(3, 2, dtype=torch.float32)", "torch.eye(2, 3)", "torch.eye(3, 3, dtype=torch.float64)",
        "torch.eye(3, 2, dtype=torch.complex128)", "torch.full((3, 2), float('nan'), dtype=torch.float64)",
        "torch.zeros(3, 2, dtype=torch.float64)", "'a'", "torch.eye(3, 2, dtype=torch.float64).numpy()",
        "1e300 * torch.eye(3, 2, dtype=torch.float64)", "torch.eye(3, 2, dtype=torch.float64).to(bool)")),
    ("return height", ("return None; height", "return 3.0; height", "return [1.0]; height", "raise ValueError('no')",
                       "import sys; sys.exit()", "import sys; sys.exit(0)", "raise KeyError(3)", "exit('x')",
                       "raise SystemExit", "return height[:5]", "print('hello'); return height", "1 / 0", "return view",
                       "import warnings; warnings.warn('look'); return height", "return height.sqrt().log()",
                       "raise StopIteration", "raise RecursionError('deep')", "return torch.empty(0)", "assert False")),
    ("import torch\n", ("import sys; sys.exit(0)\n", "import no_such\n", "raise SystemExit(3)\n",
    "print('x')\nimport torch\n",
                        "import torch\ntorch.set_default_dtype(torch.float32)\n", "(\n",
                        "import torch, numpy\nnumpy.sqrt(-1.0)\n", "import os\nos.chdir('/')\nimport torch\n")),
    ("def basis(self, view, shape)", ("def basis(self)", "def base(self, view, shape)",
    "def basis(self, view, shape, more)",
                                      "basis = 3\n    def other(self, view, shape)",
                                      "async def basis(self, view, shape)")),
    *MORE,
    ("class Pull(Effect):", ("class Pull:", "class Pull(Effect, int):", "@property\nclass Pull(Effect):",
                             "def pull(): pass\nclass Q(Effect): pass\nclass Pull(Effect):")),
)  # fmt: skip


def damage_code(path: Path, rng: random.Random) -> Mutation:
    old, news = rng.choice(OWN_CHANGES)
    new = rng.choice(news)
    path.write_text(path.read_text().replace(old, new, 1))
    return Mutation(f"{path.name} {old[:24]!r} -> {new[:40]!r}")
