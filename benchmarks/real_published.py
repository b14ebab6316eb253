"""Published fits of a telescope and of a humanoid's arms, done again term by term and step by step."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from real_data import ARCSEC, STAR_MM, humanoid, open_set, other_arm, telescope

from ptt.effects.registry import library, make_effect
from ptt.fitting.result import FitResult
from ptt.fitting.solve import fit
from ptt.judge.ladder.climb import climb
from ptt.model.model import Model, Term, parameter_names, start_term
from ptt.run.problem import Problem

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
