"""Write data/scale.csv, a linear-scale log for `ptt backlash` from a simulated encoder; a rerun gives the same bytes.

Three sliders with lead 5 mm and play 0.041, 0.052, 0.037 mm, each under 0 and 2 kg. A motor turns two turns forward and
two back at 0.2 mm/s while the scale, 1 um per count, is read 50 times a second (4 um of motor travel per sample). The
slider's position is a play operator of the motor's, plus a screw error of 4 um once per turn and of 15 um/m, less
1.3 um of sag per kg, seen through the scale's counts. Cycle 1 is logged whole; cycles 2 to 7 give one reading each at
the stroke's end, scattered by 1 um, for the repeatability. Every slider begins with its gap taken up forward.

Usage: python data/make_scale.py [FILE]
"""

import sys
from pathlib import Path

import numpy as np

LEAD_MM, TURNS, SPEED_MM_S, RATE_HZ, COUNT_MM = 5.0, 2, 0.2, 50.0, 0.001
GAPS_MM = {1: 0.041, 2: 0.052, 3: 0.037}
PAYLOADS_KG = (0.0, 2.0)
SAG_MM_KG = 0.0013
CYCLES = 7


def play(motor: np.ndarray, gap: float) -> np.ndarray:
    """Position (n,) mm of a slider that follows its motor (n,) mm with play `gap`, taken up forward at the start."""
    position = np.empty_like(motor)
    now = motor[0] - gap / 2
    for row, value in enumerate(motor):
        now = min(max(now, value - gap / 2), value + gap / 2)
        position[row] = now
    return position


def screw(position: np.ndarray, slider: int) -> np.ndarray:
    """Slider position (n,) mm with the screw's errors added."""
    return position * (1 + 15e-6) + 0.002 * np.sin(2 * np.pi * position / LEAD_MM + slider)


def main(path: Path) -> None:
    """Write the log."""
    random = np.random.default_rng(19)
    steps = round(TURNS * LEAD_MM / SPEED_MM_S * RATE_HZ)
    rise = np.arange(steps + 1)
    turns = np.concatenate([rise, rise[-2::-1]]) * (TURNS / steps)
    lines = ["slider,payload_kg,cycle,command_turns,scale_mm,time_s"]
    for slider, gap in GAPS_MM.items():
        zero = random.uniform(20.0, 30.0)
        for payload in PAYLOADS_KG:
            moved = screw(play(turns * LEAD_MM, gap), slider) - SAG_MM_KG * payload
            reading = np.rint((zero + moved) / COUNT_MM) * COUNT_MM
            head = f"{slider},{payload:g}"
            for row, (turn, value) in enumerate(zip(turns, reading, strict=True)):
                lines.append(f"{head},1,{turn:.4f},{value:.3f},{row / RATE_HZ:.2f}")
            ends = np.rint((zero + moved[steps] + random.normal(0.0, 0.001, CYCLES - 1)) / COUNT_MM) * COUNT_MM
            for cycle, value in enumerate(ends, start=2):
                seconds = ((2 * cycle - 1) * steps) / RATE_HZ
                lines.append(f"{head},{cycle},{TURNS:.4f},{value:.3f},{seconds:.2f}")
    path.write_bytes(("\n".join(lines) + "\n").encode())


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("scale.csv"))
