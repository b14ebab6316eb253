"""Nanoseconds of a corrected command and of a forward pose, side by side in one run: `python benchmarks/commands.py`.

The model has play, homing, lead, lean and length errors on a drawn path with reversals, and a network of 60 centres.
Every way to work it out is timed in turn, several times over, and its best time counts: other programs on the machine
only ever make times longer.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import poses as poses_of
import torch
from poses import best

from nets import GaussianRbf, measure_domain
from ptt.correct.compensate import compensate
from ptt.correct.exports.c.source import source_of
from ptt.correct.predictor import Predictor
from ptt.correct.training.compensator import Compensator
from ptt.effects import library
from ptt.effects.registry import make_effect
from ptt.machine import parse_machine
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.model.model import Model, Term
from ptt.run.table import make_table

MACHINE = """
[machine]
kind = "three-ptt"
base_radius_mm = 200
platform_radius_mm = 100
link_length_mm = 300
slider_travel_mm = [150, 420]
"""
VALUES = {
    "homing-offset": [0.3, -0.2, 0.1],
    "lead-scale": [6e-5, -4e-5, 3e-5],
    "tower-tilt": [1e-3, -5e-4, 8e-4, 3e-4, -9e-4, 4e-4],
    "link-length": [0.05, -0.08, 0.02],
    "backlash": [0.04, 0.05, 0.03, 1.0],
}
CENTRES = 60
LOOP = """#define _POSIX_C_SOURCE 199309L
#include "ptt_model.c"
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
static double now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return t.tv_sec + 1e-9 * t.tv_nsec; }
int main(int count, char **given)
{
    long n = atol(given[1]), i;
    int k, j, x;
    double *p = malloc(24 * n), *q = malloc(24 * n), least[4] = {1, 1, 1, 1}, t, sum = 0, there[3];
    FILE *file = fopen("p.bin", "rb");
    ptt_state state;
    if (count != 2 || !p || !q || !file || fread(p, 24, n, file) != (size_t)n) return 1;
    for (k = 0; k < 7; ++k) {
        ptt_start(&state);
        t = now(); sum += ptt_commands(n, p, 0, &state, q); t = now() - t; if (t < least[0]) least[0] = t;
        t = now();
        for (i = 0; i < n; ++i) {
            double z = p[3 * i] * 1e-3;
            for (j = 0; j < 60; ++j) sum += exp(-z * z * j * 0.1);
            for (j = 1; j < 4; ++j) sum += sqrt(z * z + j);
        }
        t = now() - t; if (t < least[1]) least[1] = t;
        t = now(); for (i = 0; i < n; ++i) { ptt_meet(q + 3 * i, 0, there); sum += there[2]; }
        t = now() - t; if (t < least[2]) least[2] = t;
        t = now(); for (i = 0; i < n; ++i) for (x = 0; x < 3; ++x) sum += p[3 * i + x]; t = now() - t;
        if (t < least[3]) least[3] = t;
    }
    for (k = 0; k < 4; ++k) printf("%.17g ", least[k] / n);
    printf("\\n");
    return sum != sum;
}
"""


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("--rows", type=int, default=200_000)
    reader.add_argument("--linuxcnc", type=Path, help="folder of LinuxCNC's lineardeltakins-common.h")
    reader.add_argument("--klipper", type=Path, help="folder of Klipper's mathutil.py")
    given = reader.parse_args()
    rows = given.rows
    targets = path(rows)
    compensator = machine(targets)
    table = [*commands(compensator, targets), *poses(rows, given.linuxcnc, given.klipper)]
    loads = Path("/proc/loadavg").read_text().split()[0] if Path("/proc/loadavg").exists() else "?"
    print(f"{rows} rows, one thread, load {loads}")
    print(f"{'':<58}{'ns':>9}")
    for name, seconds in table:
        print(f"{name:<58}{1e9 * seconds:9.1f}")


def path(rows: int) -> np.ndarray:
    """Targets along waves of all three sliders, (n, 3) mm."""
    turn = 2.0 * np.pi * np.linspace(0.0, 1.0, rows)[:, None]
    heights = 285.0 + 32.0 * np.sin(turn * np.array([7.0, 11.0, 5.0]) + np.array([0.0, 1.9, 3.8]))
    mechanism = build_mechanism(parse_machine(MACHINE).machine)
    return np.asarray(mechanism.forward(torch.tensor(heights)).numpy())


def machine(targets: np.ndarray) -> Compensator:
    model = Model(parse_machine(MACHINE))
    for name, values in VALUES.items():
        model = model + Term(make_effect(library(), name), torch.tensor(values, dtype=torch.float64))
    random, places = np.random.default_rng(0), targets[:: max(1, len(targets) // 1500)]
    mean, scale = places.mean(axis=0), places.std(axis=0)
    scaled = (places - mean) / scale
    network = GaussianRbf(
        scaling=(mean, scale), centres=scaled[random.choice(len(scaled), CENTRES)], widths=np.full(CENTRES, 1.0),
        weights=random.normal(scale=2e-3, size=(CENTRES, 3)), threshold=np.zeros(3), slope=np.zeros((3, 3)),
        domain=measure_domain(scaled),
    )  # fmt: skip
    return Compensator(model, network, {})


def commands(compensator: Compensator, targets: np.ndarray) -> list[tuple[str, float]]:
    rows, wide = len(targets), np.random.default_rng(0).uniform(-3.0, 0.0, (2000, CENTRES))
    out = np.empty_like(wide)
    table = [(f"{CENTRES} exponentials, numpy", best(lambda: np.exp(wide, out=out), len(wide)))]
    part = targets[:20_000]
    correction, inside = compensator.network_parts()
    begin = time.perf_counter()
    slow = compensate(compensator.model, make_table(part), correction=correction, inside=inside)
    table.append(("command, ptt predict (torch, statuses and all)", (time.perf_counter() - begin) / len(part)))
    predict = Predictor(compensator)
    found = predict(part)
    apart = np.abs(found - slow.q)[slow.sent].max(axis=1)
    # Where a slider creeps through a turn by nanometres, either side of its gap is as good.
    print(f"{int((apart > 1e-9).sum())} of {len(apart)} commands of the C are not within 1e-9 mm of ptt predict")

    def whole() -> None:
        predict.start()
        predict(targets)

    def single() -> None:
        for row in part:
            predict(row)

    table.append(("command, predictor from Python, one array", best(whole, rows)))
    table.append(("command, predictor from Python, one by one", best(single, len(part))))
    table += onnx_row(compensator, targets[:100_000])
    with tempfile.TemporaryDirectory() as folder:
        times = compiled(compensator, targets, Path(folder))
        table.append(("command, exported C at -O2", times[0]))
        table.append((f"{CENTRES} exponentials and three roots, C at -O2", times[1]))
        table.append(("pose, drawing, exported C at -O2", times[2]))
        table.append(("reading the three numbers of a pose, C at -O2", times[3]))
    return table


def compiled(compensator: Compensator, targets: np.ndarray, folder: Path) -> list[float]:
    source = source_of(compensator, ["benchmark"])
    (folder / "ptt_model.h").write_text(source.header)
    (folder / "ptt_model.c").write_text(source.body)
    (folder / "loop.c").write_text(LOOP)
    targets.tofile(folder / "p.bin")
    compiler = shutil.which("gcc") or sys.exit("no gcc")
    subprocess.run([compiler, "-std=c99", "-O2", "-o", "loop", "loop.c", "-lm"], cwd=folder, check=True)
    done = subprocess.run(["./loop", str(len(targets))], cwd=folder, capture_output=True, text=True, check=True)
    return [float(word) for word in done.stdout.split()]


def onnx_row(compensator: Compensator, targets: np.ndarray) -> list[tuple[str, float]]:
    try:
        import onnxruntime

        from ptt.correct.exports.onnx import build_graph
    except ImportError:
        return []
    still = replace(compensator, model=compensator.model.without("backlash"))
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(build_graph(still, []).SerializeToString(), options)
    blocks = np.array_split(targets, max(1, len(targets) // 2000))

    def work() -> None:
        for block in blocks:
            session.run(["b"], {"p": block})

    return [("command without reversal, ONNX graph", best(work, len(targets)))]


def poses(rows: int, linuxcnc: Path | None, klipper: Path | None) -> list[poses_of.Row]:
    mechanism = build_mechanism(parse_machine(MACHINE).machine)
    assert isinstance(mechanism, ThreePtt)
    table = [*poses_of.ours(mechanism, rows), *poses_of.textbook(mechanism, rows)]
    if linuxcnc is not None:
        compiler = shutil.which("gcc") or sys.exit("no gcc")
        with tempfile.TemporaryDirectory() as folder:
            table += poses_of.linuxcnc(mechanism, rows, linuxcnc.absolute(), compiler, Path(folder))
    return table if klipper is None else table + poses_of.klipper(mechanism, klipper)


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
