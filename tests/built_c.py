"""The C of a model, built and called from this process, and models and paths to hold it against Python."""

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import torch

from ptt.correct.compensate import compensate
from ptt.correct.exports.c.source import source_of
from ptt.correct.training.compensator import Compensator
from ptt.effects import library
from ptt.effects.registry import make_effect
from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.model.model import Model, Term
from ptt.run.table import Table, make_table

FLAGS = ("-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror")
ARM_ONLY_ONE = ("homing-offset",)  # one thing with dh-offsets


class Context(ctypes.Structure):
    _fields_ = [(name, ctypes.c_double) for name in ("payload_kg", "temp_c", "feed_mm_s", "time_s")]


class Built:
    """The C of a model in this process."""

    def __init__(self, compensator: Compensator, folder: Path) -> None:
        source = source_of(compensator, ["a model"])
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "ptt_model.h").write_text(source.header)
        (folder / "ptt_model.c").write_text(source.body)
        subprocess.run(["gcc", *FLAGS, "-shared", "-fPIC", "-o", "m.so", "ptt_model.c", "-lm"], cwd=folder, check=True)
        self.code = ctypes.CDLL(str(folder / "m.so"))
        self.joints = compensator.model.joints
        self.cannot = source.parts.cannot

    def start(self) -> ctypes.Array[ctypes.c_char]:
        state = ctypes.create_string_buffer(4096)
        self.code.ptt_start(state)
        return state

    def commands(self, p: np.ndarray, context: Context) -> tuple[int, np.ndarray]:
        p, q = np.ascontiguousarray(p), np.empty((len(p), self.joints))
        call = self.code.ptt_commands
        code = call(ctypes.c_long(len(p)), pointer(p), ctypes.byref(context), self.start(), pointer(q))
        return code, q

    def one_by_one(self, rows: np.ndarray, context: Context, name: str = "ptt_command") -> tuple[list[int], np.ndarray]:
        q, state, codes = np.empty((len(rows), self.joints)), self.start(), []
        for row, here in zip(np.ascontiguousarray(rows), q, strict=True):
            codes.append(getattr(self.code, name)(pointer(row), ctypes.byref(context), state, pointer(here)))
        return codes, q

    def forward(self, q: np.ndarray, context: Context) -> np.ndarray:
        p = np.empty((len(q), 3))
        for row, here in zip(np.ascontiguousarray(q), p, strict=True):
            self.code.ptt_forward(pointer(row), ctypes.byref(context), pointer(here))
        return p


def pointer(values: np.ndarray):
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def random_model(file: MachineFile, seed: int, names: tuple[str, ...] | None = None) -> Model:
    """A model with random parameters of usual size for all effects that C holds, or those named."""
    random, model, kind = np.random.default_rng(seed), Model(file), file.machine.kind
    for name in names or tuple(library()):
        effect = make_effect(library(), name)
        alone = kind == "serial" and name in ARM_ONLY_ONE
        if kind not in effect.mechanisms or effect.stage == "metrology" or name == "following-error" or alone:
            continue
        model = model + Term(effect, torch.tensor(np.concatenate(values_of(effect, file, model.joints, random))))
    return model


def values_of(effect, file: MachineFile, joints: int, random: np.random.Generator) -> list[np.ndarray]:
    values = []
    for parameter in effect.parameters:
        size, usual = parameter.size(joints), parameter.on(file.machine.kind).usual
        drawn = random.normal(size=size) * usual
        if parameter.stem in ("from", "to"):
            drawn = np.array(file.machine.travel_ends)[:, int(parameter.stem == "to")]
        elif parameter.role != "linear":
            drawn = np.full(size, 5.0 if parameter.stem == "period" else usual)
        values.append(np.abs(drawn) if parameter.lower == 0.0 or effect.name == "backlash" else drawn)
    return values


def path_of(file: MachineFile, seed: int, rows: int = 120) -> np.ndarray:
    """Rows of a smooth path with many reversals, well inside the travel, as joint values."""
    random = np.random.default_rng(seed)
    if file.machine.kind == "serial":
        low, high = build_mechanism(file.machine).limits().clamp(-2.0, 2.0).numpy()
    else:
        low, high = np.array(file.machine.travel_ends).T
    time = np.linspace(0.0, 1.0, rows)[:, None]
    waves = sum(np.sin(2 * np.pi * (random.uniform(1, 4, len(low)) * time + random.random(len(low)))) for _ in range(2))
    return np.asarray((low + high) / 2 + 0.1 * waves * (high - low))


def expected(compensator: Compensator, targets: Table):
    correction, inside = compensator.network_parts()
    return compensate(compensator.model, targets, correction=correction, inside=inside)


def check(compensator: Compensator, targets: np.ndarray, folder: Path, payload: float = 1.3, temp: float = 26.0):
    """Commands of C against those of Python, on rows both send; and that they send the same rows."""
    table = make_table(targets, payload_kg=payload, temp_c=temp)
    found = expected(compensator, table)
    built = Built(compensator, folder)
    code, q = built.commands(targets, Context(payload, temp, 0.0, 0.0))
    np.testing.assert_array_equal(np.isfinite(q).all(axis=1), found.sent)
    np.testing.assert_allclose(q[found.sent], found.q[found.sent], rtol=0.0, atol=1e-9)
    return built, found, code
