"""Commands row by row from the exported C of a model, compiled once and called through ctypes.

A command of an array takes about a microsecond or less, one that is asked for alone a few, most of it the call from
Python (docs/export.md has figures).
"""

import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ptt.correct.exports.c.source import source_of
from ptt.errors import InputError, PttError

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator

COMPILERS = ("cc", "gcc", "clang")
FLAGS = ("-std=c99", "-O3", "-shared", "-fPIC")
HERE = "-march=native"  # it runs on the machine that builds it; not every compiler knows the flag
# The size of ptt_state, so that the caller can allocate one.
STATE = "\nconst unsigned long ptt_state_bytes = sizeof(ptt_state);\n"
CODES = ("ok", "outside the training domain: physics alone", "out of reach", "near singular")


class _Context(ctypes.Structure):
    _fields_ = [(name, ctypes.c_double) for name in ("payload_kg", "temp_c", "feed_mm_s", "time_s")]


class Predictor:
    """Corrected commands of a machine that goes from one target to the next.

    It remembers the travel from call to call, so rows may come one by one, in blocks, or as a stream; memory does not
    grow with their number. The commands are those of `ptt predict`, reversal in software.

    Attributes:
        joints: k.
        code: index into `CODES` of the status of the last row, or of the gravest one of a block.
    """

    def __init__(self, compensator: "Compensator") -> None:
        """Build the C of a model.

        Args:
            compensator: physics, and a network where there is one.

        Raises:
            PttError: there is no C compiler, or it fails.
            InputError: the model has effects that C does not hold.
        """
        source = source_of(compensator, ["built for calls from Python"])
        for key, why in source.parts.cannot.items():
            raise InputError(
                f"effect '{key}' cannot be computed row by row: {why}", fix="use `ptt predict`, or leave it out"
            )
        self.joints = compensator.model.joints
        self.code = 0
        self._library = _build(source.header, source.body + STATE)
        self._command, self._commands = self._library.ptt_command, self._library.ptt_commands
        size = ctypes.c_ulong.in_dll(self._library, "ptt_state_bytes").value
        self._state = (ctypes.c_double * -(-size // ctypes.sizeof(ctypes.c_double)))()  # doubles, so that it is aligned
        self._context = _Context(0.0, compensator.model.file.machine.reference_temp_c, 0.0, 0.0)
        self._p, self._q = (ctypes.c_double * 3)(), (ctypes.c_double * self.joints)()
        self._near = ctypes.byref(self._context)
        self.start()

    def start(self) -> None:
        """Forget all travel."""
        self._library.ptt_start(self._state)

    def load(self, *, payload_kg: float | None = None, temp_c: float | None = None) -> None:
        """Say what the rows to come carry, and how warm it is; what is not named stays.

        Args:
            payload_kg: kg.
            temp_c: degrees C.
        """
        if payload_kg is not None:
            self._context.payload_kg = payload_kg
        if temp_c is not None:
            self._context.temp_c = temp_c

    def __call__(self, p: "np.ndarray | tuple[float, float, float]") -> np.ndarray:
        """The command of one target, or of several.

        Args:
            p: (3,) or (n, 3) mm. Given at once, a run's first row is taken to arrive as the next one moves; alone it is
                taken to arrive upward.

        Returns:
            (k,) or (n, k) mm or rad; NaN where nothing is to be sent.

        Raises:
            InputError: targets of any other shape.
        """
        if isinstance(p, np.ndarray) and p.ndim == 2:
            return self._rows(p)
        try:
            self._p[0], self._p[1], self._p[2] = p
        except (TypeError, ValueError) as error:
            raise InputError("a target has three numbers", fix="give x, y, z in mm, or an (n, 3) array") from error
        self.code = self._command(self._p, self._near, self._state, self._q)
        return np.array(self._q)

    def _rows(self, p: np.ndarray) -> np.ndarray:
        if p.shape[1] != 3:
            raise InputError(f"targets have {p.shape[1]} columns", fix="give x, y, z in mm, (n, 3)")
        rows = np.ascontiguousarray(p, dtype=np.float64)
        q = np.empty((len(rows), self.joints))
        count = ctypes.c_long(len(rows))
        self.code = self._commands(count, _pointer(rows), self._near, self._state, _pointer(q))
        return q


def _pointer(values: np.ndarray) -> "ctypes._Pointer[ctypes.c_double]":
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def _build(header: str, body: str) -> ctypes.CDLL:
    compiler = next((path for path in map(shutil.which, COMPILERS) if path), None)
    if compiler is None:
        raise PttError("no C compiler (cc, gcc or clang) is there: install one, or use `ptt predict`")
    with tempfile.TemporaryDirectory(prefix="ptt-") as folder:
        place = Path(folder)
        (place / "ptt_model.h").write_text(header)
        (place / "ptt_model.c").write_text(body)
        made = place / "ptt_model.so"
        for flags in ((*FLAGS, HERE), FLAGS):
            command = [compiler, *flags, "-o", str(made), "ptt_model.c", "-lm"]
            done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
            if not done.returncode:
                break
        else:
            raise PttError(
                f"{compiler} fails: {done.stderr.strip().splitlines()[0] if done.stderr else done.returncode}"
            )
        return ctypes.CDLL(str(made))  # stays loaded after its file is gone
