"""Real measurements with published results, through the same verbs as any run.

Run it as `python benchmarks/real.py [PART ...] [--out FIGURES.json] [--stride 5] [--clones DIR]`; without a part all of
them. Sets that are not beside the project (shared/data) are skipped and named.

    telescope    pointing of a two-axis mount: terms beside the published fit
    humanoid     two arms of Agile Justin: the ladder of errors and leave-one-out, beside the published ones
    short        dh-offsets fitted on few rows of an arm: must not raise the error of the rows it has not seen
    transfer     UR10: fitted on series A and B, tested on C
    diagnose     names and verdict of every set and of its two halves, and what one half's model leaves on the other
    printers     linear deltas: heights left out in turn
    arms         the same as diagnose of two industrial arms, whose readings lie in a folder of clones (real_arms.py)

Lengths are um, RMS of the distance, unless said. Halves are every other one of ten blocks of travel, all visits of a
pose together.
"""

import argparse
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import klipper
import numpy as np
import real_arms
import torch
import ur10 as ur10_bench
from real_data import ARCSEC, STAR_MM, here, humanoid, open_set, other_arm, plain_telescope, telescope, ur10

from ptt.diagnosis.diagnose import diagnose
from ptt.effects.registry import library, make_effect
from ptt.errors import PttError
from ptt.fitting.result import FitResult
from ptt.fitting.solve import fit
from ptt.judge.ladder.climb import climb
from ptt.model.model import Model, Term, parameter_names, start_term
from ptt.run.holdout import blocks
from ptt.run.problem import Problem

FOLDERS: dict[str, str | None] = {
    "telescope": "rts2_pointing", "humanoid": "dlr_justin", "short": "ur10_ipa", "transfer": "ur10_ipa",
    "diagnose": "", "printers": "klipper_delta", "arms": None,
}  # fmt: skip
SIDES = ("right", "left")
LADDER = {"as given": 21.33, "homing-offset": 18.18, "dh-offsets": 10.5, "self-weight": 5.64, "other-arm": None}
LEFT_OUT = {"self-weight": 9.09, "dalpha": 6.48, "dtheta": 6.35, "da": 4.33, "dd": 3.46}
# Term: parameter, published value, and the standard error that the published fit has where it is done again. The lean
# is what that fit finds: with it, and only with it, the published terms come out to the last digit.
POINTING = {
    "index of altitude": ("dtheta_rad 3", -15.9, 1.5),
    "axes not square": ("dalpha_rad 2", -17.2, 1.3),
    "tube flexure": ("along_rad 3.3", 9.9, 2.2),
    "lean of the mount": ("dalpha_rad 1", 4.6, 0.7),
}
SHORT = (50, 75, 100, 200, 400)
DRAWS = 8

Row = dict[str, Any]


def mean_mm(fitted: FitResult, problem: Problem) -> float:
    """Mean distance left, mm, gross errors included, as published."""
    return float(np.linalg.norm(fitted.residual[problem.used], axis=1).mean())


def rms_um(fitted: FitResult, rows: np.ndarray) -> float:
    """RMS of the distance, um, gross errors of the fit's own left out."""
    kept = rows & ~fitted.outliers
    return float(np.sqrt(np.square(fitted.residual[kept]).sum(axis=1).mean()) * 1e3)


def with_effects(problem: Problem, names: Sequence[str]) -> Model:
    """The drawing with effects."""
    model = Model(problem.file)
    for name in names:
        model = model + make_effect(library(), name)
    return model


def humanoid_ladder() -> list[Row]:
    """Print the ladder of both arms beside the published one: mean errors in mm, both hands together."""
    steps: dict[str, list[float]] = {}
    for side in SIDES:
        problem = open_set(*humanoid(side))
        effects = [make_effect(library(), name) for name in ("dh-offsets", "self-weight")]
        ladders = [
            climb(Model(problem.file), problem, [make_effect(library(), "homing-offset")]),
            climb(Model(problem.file), problem, [*effects, other_arm(side)]),
        ]
        found = {step.effect: mean_mm(step.fitted, problem) for ladder in ladders for step in ladder.steps}
        for name, value in found.items():
            steps.setdefault(name, []).append(value)
    print(f"Agile Justin, mean error in mm{'right':>16}{'left':>8}{'both':>8}{'published':>11}")
    rows = []
    for name, bar in LADDER.items():
        both = float(np.mean(steps[name]))
        told = f"{bar:11.2f}" if bar else "          -"
        print(f"  {name:<36}{steps[name][0]:8.2f}{steps[name][1]:8.2f}{both:8.2f}{told}", flush=True)
        rows.append({"set": "humanoid", "step": name, "mean_mm": both, "published_mm": bar})
    return rows


def humanoid_left_out() -> list[Row]:
    """Print what leaving one cause out of the full model costs, beside the published order."""
    means: dict[str, list[float]] = {}
    for side in SIDES:
        problem = open_set(*humanoid(side))
        full = with_effects(problem, ("dh-offsets", "self-weight")) + other_arm(side)
        cases = {"nothing": full, "self-weight": full.without("self-weight").without("other-arm")}
        cases |= {stem: _held(full, problem, stem) for stem in ("dalpha", "dtheta", "da", "dd")}
        for name, model in cases.items():
            means.setdefault(name, []).append(mean_mm(fit(model, problem), problem))
    print("leaving one cause out, mean error in mm of both hands (published, beside lateral compliance too)")
    for name, value in means.items():
        print(f"  {name:<36}{np.mean(value):8.2f}{LEFT_OUT.get(name, 3.12):8.2f}", flush=True)
    return [
        {"set": "humanoid", "left out": name, "mean_mm": float(np.mean(value)), "published_mm": LEFT_OUT.get(name)}
        for name, value in means.items()
    ]


def _held(model: Model, problem: Problem, stem: str) -> Model:
    """The model with one kind of link parameter held at the drawing; twist takes the Hayati angle with it."""
    stems = frozenset({stem, "dbeta"}) if stem == "dalpha" else frozenset({stem})
    terms = (
        replace(start_term(term.effect, problem.view), fixed=stems) if term.effect.name == "dh-offsets" else term
        for term in model.terms
    )
    return replace(model, terms=tuple(terms))


def telescope_terms() -> list[Row]:
    """Print the terms of the mount beside the published ones, arcsec."""
    problem = open_set(*telescope())
    fitted = fit(with_effects(problem, ("dh-offsets", "self-weight")), problem)
    found = {name: pair for term in fitted.model.terms for name, pair in _named(term, problem.view.joints).items()}
    rest = rms_um(fitted, problem.used) / np.sqrt(2.0) * 1e-3 / STAR_MM / ARCSEC
    print(f"telescope, arcsec; {problem.used.sum()} directions, rest {rest:.1f} a coordinate{'published':>20}")
    rows = []
    for name, (key, published, error) in POINTING.items():
        value, std = (part / ARCSEC for part in found[key])
        print(f"  {name:<24}{value:8.1f} +- {std:4.1f}{published:20.1f} +- {error:.1f}")
        rows.append({"set": "telescope", "term": name, "arcsec": value, "std": std, "published": (published, error)})
    return rows


def telescope_drift() -> list[Row]:
    """Print how what the terms leave moves during each night: mean along azimuth and altitude, arcsec on the sky.

    In the second night it moves steadily, in both; no published term has time in it. A diagnosis that names something
    that changed during the run is right that something did; as a step it is only an approximation.
    """
    problem = open_set(*telescope())
    fitted = fit(with_effects(problem, ("dh-offsets", "self-weight")), problem)
    q, hours = problem.view.q.numpy(), problem.view.time.numpy() / 3600.0
    azimuth, altitude = -q[:, 1], q[:, 2]
    level = np.column_stack([-np.sin(azimuth), -np.cos(azimuth), np.zeros(len(q))])
    upward = np.column_stack(
        [-np.sin(altitude) * np.cos(azimuth), np.sin(altitude) * np.sin(azimuth), np.cos(altitude)]
    )
    kept = problem.used & ~fitted.outliers
    night = np.cumsum(np.diff(hours, prepend=hours[:1]) > 6.0)
    rows = []
    for which in np.unique(night):
        own = np.flatnonzero(kept & (night == which))
        for part in np.array_split(own, 4):
            sky = [(fitted.residual[part] * way[part]).sum(axis=1) / STAR_MM / ARCSEC for way in (level, upward)]
            told = [(float(item.mean()), float(item.std() / np.sqrt(len(item)))) for item in sky]
            text = "".join(
                f"{name:>10} {mean:6.1f} +- {error:.1f}"
                for name, (mean, error) in zip(("az", "alt"), told, strict=True)
            )
            print(f"  night {which + 1}, {hours[part[0]]:5.1f} .. {hours[part[-1]]:5.1f} h {text}")
            rows.append(
                {"set": "telescope", "night": int(which) + 1, "hours": float(hours[part].mean()), "arcsec": told}
            )
    return rows


def _named(term: Term, joints: int) -> dict[str, tuple[float, float]]:
    assert term.std is not None
    names = parameter_names(term.effect, "serial", joints)
    return {name: (float(v), float(s)) for name, v, s in zip(names, term.theta, term.std, strict=True)}


def short_runs() -> list[Row]:
    """Print what dh-offsets leaves on unseen rows where it was fitted on few."""
    cases = {f"UR10 {name}": open_set(*ur10(name)) for name in "BCD"}
    if here("dlr_justin"):
        cases |= {f"Justin {side}": open_set(*humanoid(side)) for side in SIDES}
    print(f"fitted on few rows, RMS on all others, um (median of {DRAWS} draws): drawing -> + dh-offsets (times worse)")
    rows = []
    for name, problem in cases.items():
        text = f"  {name:<14}"
        for count in SHORT:
            pairs = np.array([unseen(problem, count, seed) for seed in range(DRAWS)])
            before, after = np.median(pairs, axis=0)
            worse = int((pairs[:, 1] > pairs[:, 0]).sum())
            text += f"  {count}: {before:.0f} -> {after:.0f} ({worse})"
            rows.append({"set": name, "rows": count, "drawing": before, "dh-offsets": after, "worse": worse})
        print(text, flush=True)
    return rows


def unseen(problem: Problem, count: int, seed: int) -> tuple[float, float]:
    """Error on unseen rows, without and with dh-offsets fitted on a stretch of consecutive rows."""
    rows = np.flatnonzero(problem.used)
    first = int(np.random.default_rng(seed).integers(0, len(rows) - count))
    shown = np.isin(np.arange(problem.table.rows), rows[first : first + count])
    part = problem.masked(~shown)
    hidden = problem.used & ~shown
    return tuple(rms_um(fit(with_effects(problem, names), part), hidden) for names in ((), ("dh-offsets",)))


def transfer(stride: int) -> list[Row]:
    """The UR10 fitted on two series and tested on a third."""
    rows: list[Row] = []
    ur10_bench.transfer(stride, rows)
    return rows


def halves(problem: Problem) -> list[np.ndarray]:
    """Every other block, (n,) bool each."""
    block = blocks(problem.table)
    return [problem.used & (block % 2 == parity) for parity in range(2)]


def diagnose_all(stride: int) -> list[Row]:
    """Print what is named on every set and its halves, and what a half's model leaves on the other."""
    cases: dict[str, Callable[[], Problem]] = {}
    if here("rts2_pointing"):
        cases["telescope"] = lambda: open_set(*telescope())
        cases |= {
            f"two axes, {frame}": lambda frame=frame: open_set(*plain_telescope(frame))
            for frame in ("trusted", "fitted")
        }
    if here("dlr_justin"):
        cases |= {f"Justin {side}": lambda side=side: open_set(*humanoid(side)) for side in SIDES}
    if here("ur10_ipa"):
        steps = {"A": stride, "B": 1, "C": 1, "D": 1}
        cases |= {f"UR10 {name}": lambda name=name: open_set(*ur10(name, steps[name])) for name in steps}
    return [row for name, load in cases.items() for row in _replicate(name, load())]


def diagnose_arms(clones: Path) -> list[Row]:
    """The same of two industrial arms."""
    rows = list[Row]()
    if (clones / real_arms.TX2).exists():
        for path in real_arms.PATHS:
            rows += _replicate(f"TX2 {path}", open_set(*real_arms.tx2(clones, path)))
    if (clones / real_arms.IRB120).exists():
        rows += _replicate("IRB 120", open_set(*real_arms.irb120(clones)))
    if not rows:
        print(f"arms: skipped, no clone in {clones}")
    return rows


def _replicate(name: str, problem: Problem) -> list[Row]:
    rows = [_look(name, "all", problem, np.ones(problem.table.rows, dtype=bool))]
    for index, half in enumerate(halves(problem)):
        rows.append(_look(name, f"half {index + 1}", problem, half))
    agree = _alike(rows[1]["suggested"], rows[2]["suggested"])
    print(f"  {name}: the halves name {'the same' if agree else 'different effects'}", flush=True)
    return rows


def _alike(one: Sequence[Sequence[str]], other: Sequence[Sequence[str]]) -> bool:
    """Whether each step of either has its like in the other: the same name, or a tie that holds it."""

    def met(steps: Sequence[Sequence[str]], others: Sequence[Sequence[str]]) -> bool:
        return all(any(set(step) & set(their) for their in others) for step in steps)

    return len(one) == len(other) and met(one, other) and met(other, one)


def _look(name: str, which: str, problem: Problem, shown: np.ndarray) -> Row:
    started = time.perf_counter()
    part = problem.masked(~shown)
    found = diagnose(Model(problem.file), part)
    named = [step[0] for step in found.suggested]
    row: Row = {
        "set": name, "rows": which, "verdict": found.verdict, "named": named, "words": found.words,
        "suggested": [list(step) for step in found.suggested], "seconds": time.perf_counter() - started,
    }  # fmt: skip
    hidden = problem.used & ~shown
    text = ""
    if hidden.any():
        plain, model = (fit(with_effects(problem, names), part) for names in ((), named))
        row["unseen_um"] = {"drawing": rms_um(plain, hidden), "model": rms_um(model, hidden)}
        text = "; other half {drawing:.0f} -> {model:.0f} um".format(**row["unseen_um"])
    told = " + ".join("/".join(step) for step in row["suggested"]) or "-"
    print(f"  {name:<14}{which:<8}{found.verdict:<17}{told}{text}  [{row['seconds']:.0f} s]", flush=True)
    return row


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[*FOLDERS, []], metavar="PART")
    parser.add_argument("--stride", type=int, default=5, help="of UR10 series A")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--clones", type=Path, default=Path(), help="folder that real_arms.py's clones lie in")
    asked = parser.parse_args()
    torch.set_num_threads(1)
    work: dict[str, Callable[[], list[Row] | None]] = {
        "telescope": lambda: telescope_terms() + telescope_drift(),
        "humanoid": lambda: humanoid_ladder() + humanoid_left_out(),
        "short": short_runs,
        "transfer": lambda: transfer(asked.stride),
        "diagnose": lambda: diagnose_all(asked.stride),
        "printers": klipper.main,
        "arms": lambda: diagnose_arms(asked.clones),
    }
    figures: dict[str, Any] = {}
    for part in asked.parts or work:
        folder = FOLDERS[part]
        if folder is not None and not here(folder):
            print(f"{part}: skipped, {folder} is not beside the project")
            continue
        try:
            figures[part] = work[part]()
        except PttError as error:
            print(f"{part}: {error}")
        if asked.out:
            asked.out.parent.mkdir(parents=True, exist_ok=True)
            asked.out.write_text(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
