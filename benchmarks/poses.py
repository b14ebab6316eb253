"""Ways to work out where a 3-PTT's tool is, by nanoseconds a pose, ours beside those of others: for `commands.py`.

Others' code is not ours to pass on: LinuxCNC's `lineardeltakins-common.h` and Klipper's `mathutil.py` are timed in the
folders that hold them, and before that held against ours.
"""

import importlib
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from ptt.mechanisms.three_ptt import ThreePtt

TRIES = 5
Row = tuple[str, float]
LINUXCNC = """#define _GNU_SOURCE
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "lineardeltakins-common.h"
static double now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return t.tv_sec + 1e-9 * t.tv_nsec; }
int main(int count, char **given)
{
    long n = atol(given[1]), i;
    int k;
    double *q = malloc(24 * n), *p = malloc(24 * n), least = 1, t, joints[9] = {0};
    FILE *file = fopen("q.bin", "rb");
    EmcPose pose;
    if (count != 4 || !q || !p || !file || fread(q, 24, n, file) != (size_t)n) return 1;
    set_geometry(atof(given[2]), atof(given[3]));
    for (k = 0; k < 7; ++k) {
        t = now();
        for (i = 0; i < n; ++i) {
            joints[0] = q[3 * i]; joints[1] = q[3 * i + 1]; joints[2] = q[3 * i + 2];
            kinematics_forward(joints, &pose);
            p[3 * i] = pose.tran.x; p[3 * i + 1] = pose.tran.y; p[3 * i + 2] = pose.tran.z;
        }
        t = now() - t; if (t < least) least = t;
    }
    fclose(file); file = fopen("p.bin", "wb");
    fwrite(p, 24, n, file); fclose(file);
    printf("%.17g", least / n);
    return 0;
}
"""
POSE = """typedef struct { double x, y, z; } PmCartesian;
typedef struct { PmCartesian tran; double a, b, c, u, v, w; } EmcPose;
"""


def best(work: Callable[[], object], rows: int, tries: int = TRIES) -> float:
    """Least seconds a row of several tries."""
    times = []
    for _ in range(tries):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times) / rows


def ours(mechanism: ThreePtt, rows: int) -> list[Row]:
    """Torch as it is and compiled, rows as triplets and column by column, beside a copy of them."""
    q = heights(rows)
    by_columns, compiled = q.T.contiguous().T, torch.compile(mechanism.forward, dynamic=False)
    assert max(float((compiled(given) - mechanism.forward(q)).abs().max()) for given in (q, by_columns)) < 1e-9
    return [
        ("pose, torch", best(lambda: mechanism.forward(q), rows)),
        ("pose, torch.compile, row by row", best(lambda: compiled(q), rows, 4 * TRIES)),
        ("pose, torch.compile, by columns", best(lambda: compiled(by_columns), rows, 4 * TRIES)),
        ("copying the three numbers of a pose, torch", best(q.clone, rows, 4 * TRIES)),
    ]


def textbook(mechanism: ThreePtt, rows: int) -> list[Row]:
    """Plain numpy: an orthonormal frame on the first two centres."""
    q = heights(rows).numpy()
    apart = np.abs(trilaterate(mechanism, q) - mechanism.forward(torch.from_numpy(q)).numpy()).max()
    assert apart < 1e-9, apart
    return [("pose, numpy, a textbook's trilateration", best(lambda: trilaterate(mechanism, q), rows))]


def trilaterate(mechanism: ThreePtt, q: np.ndarray) -> np.ndarray:
    """(n, 3) mm of slider heights (n, 3) mm; sliders above the platform, upright rails."""
    link, centre = mechanism.link.numpy(), np.broadcast_to(mechanism.foot.numpy(), (len(q), 3, 3)).copy()
    centre[:, :, 2] += q
    first, second, third = centre[:, 0], centre[:, 1] - centre[:, 0], centre[:, 2] - centre[:, 0]
    distance = np.linalg.norm(second, axis=1, keepdims=True)
    ex = second / distance
    i = (ex * third).sum(1, keepdims=True)
    ey = third - i * ex
    ey /= np.linalg.norm(ey, axis=1, keepdims=True)
    ez = np.cross(ex, ey)
    j = (ey * third).sum(1, keepdims=True)
    x = (link[0] ** 2 - link[1] ** 2 + distance**2) / (2.0 * distance)
    y = (link[0] ** 2 - link[2] ** 2 + i**2 + j**2 - 2.0 * i * x) / (2.0 * j)
    return np.asarray(first + x * ex + y * ey - np.sqrt(link[0] ** 2 - x**2 - y**2) * ez)


def linuxcnc(mechanism: ThreePtt, rows: int, source: Path, compiler: str, folder: Path) -> list[Row]:
    """LinuxCNC's own C, with its towers at 90, 210 and 330 degrees and heights from the plane of its drawing."""
    radius, link = float(mechanism.foot[0, :2].norm()), float(mechanism.link[0])
    azimuth = np.deg2rad([90.0, 210.0, 330.0])
    feet = np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), np.zeros(3)])
    same = ThreePtt.from_legs(feet, [[0.0, 0.0, 1.0]] * 3, [link] * 3, np.zeros((3, 3)))
    q = heights(rows).numpy()
    (folder / "emcpos.h").write_text(POSE)
    (folder / "forward.c").write_text(LINUXCNC)
    q.tofile(folder / "q.bin")
    build = [compiler, "-O2", "-I", str(source), "-I.", "-o", "forward", "forward.c", "-lm"]
    subprocess.run(build, cwd=folder, check=True)
    given = ["./forward", str(rows), f"{radius!r}", f"{link!r}"]
    seconds = float(subprocess.run(given, cwd=folder, capture_output=True, text=True, check=True).stdout)
    apart = np.abs(np.fromfile(folder / "p.bin").reshape(-1, 3) - same.forward(torch.from_numpy(q)).numpy()).max()
    assert apart < 1e-9, apart
    return [("pose, LinuxCNC's lineardeltakins, C at -O2", seconds)]


def klipper(mechanism: ThreePtt, source: Path) -> list[Row]:
    """Klipper's own trilateration, in Python, one pose after the other."""
    sys.path.insert(0, str(source))
    mathutil = importlib.import_module("mathutil")
    q, feet, squares = heights(2000), mechanism.foot.tolist(), (mechanism.link**2).tolist()
    wanted = mechanism.forward(q).tolist()

    def work() -> list[list[float]]:
        return [
            mathutil.trilateration([(x, y, z + up) for (x, y, z), up in zip(feet, row, strict=True)], squares)
            for row in q.tolist()
        ]

    apart = np.abs(np.array(work()) - np.array(wanted)).max()
    assert apart < 1e-9, apart
    return [("pose, Klipper's mathutil, Python one by one", best(work, len(q)))]


def heights(rows: int) -> torch.Tensor:
    """Slider heights all over the workspace, (n, 3) mm."""
    return torch.tensor(285.0 + 32.0 * np.random.default_rng(0).uniform(-1.0, 1.0, (rows, 3)))
