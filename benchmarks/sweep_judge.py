"""What a diagnosis is worth once the truth is known: names, verdict, statements, parameters, commands."""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ptt.challenge.hide import faults_of
from ptt.challenge.remeasure import remeasure
from ptt.challenge.score import judge
from ptt.challenge.truth import READINGS, UM_PER_MM, Truth, mount_columns, without_set_up
from ptt.model.model import Model
from ptt.rig import simulate
from ptt.rig.draw import DrawnRig
from ptt.rig.motion import travel_direction
from ptt.run.axes import rms_length

GROUP = 3  # effects in a declared group, at most
ALIKE = 0.9  # correlation with a true variable from which another says the same of this run
WORSE = 0.25  # of the noise of one reading by which a compensated tool may miss by more than before
# Parameters that a rig holds in the library's own form: effect -> parameter -> key of the rig and factor.
SAME: dict[str, dict[str, tuple[str, float]]] = {
    "homing-offset": {"offset_mm": ("homing_mm", 1.0)},
    "homing-slip": {"slip_mm": ("slip_mm", 1.0)},
    "lead-scale": {"scale": ("scale_um_per_m", 1e-6)},
    "backlash": {"gap_mm": ("backlash_mm", 1.0)},
    "windup": {"height_mm": ("windup_um", 1e-3)},
    "following-error": {"lag_s": ("following_s", 1.0)},
    "screw-growth": {"growth_per_k": ("growth_um_per_m_k", 1e-6)},
    "axis-compliance": {"compliance_mm_per_n": ("compliance_um_per_n", 1e-3)},
    "tower-position": {"radial_mm": ("tower_radial_mm", 1.0), "tangential_mm": ("tower_tangential_mm", 1.0)},
    "tower-tilt": {"radial_rad": ("lean_radial_mrad", 1e-3), "tangential_rad": ("lean_tangential_mrad", 1e-3)},
    "link-length": {"length_mm": ("link_mm", 1.0)},
    "joint-clearance": {"clearance_mm": ("clearance_um", 1e-3)},
    "link-compliance": {"compliance_mm_per_n": ("link_compliance_um_per_n", 1e-3)},
    "platform-twist": {
        "radial_rad": ("platform_axis_radial_mrad", 1e-3),
        "upward_rad": ("platform_axis_vertical_mrad", 1e-3),
    },
    "column-bend": {"sway_mm_per_kg": ("column_bend_um_per_kg", 1e-3)},
    "frame-growth": {"radius_per_k": ("frame_um_per_m_k", 1e-6), "link_per_k": ("link_um_per_m_k", 1e-6)},
    "tracker-scale": {"scale": ("scale_ppm", 1e-6)},
}
SAME_OF_ARM: dict[str, dict[str, tuple[str, float]]] = {
    "homing-slip": {"slip_rad": ("slip_mrad", 1e-3)},
    "lead-scale": {"scale": ("scale_urad_per_rad", 1e-6)},
    "backlash": {"gap_rad": ("backlash_mrad", 1e-3)},
    "windup": {"height_rad": ("windup_urad", 1e-6)},
    "axis-compliance": {"compliance_rad_per_nmm": ("compliance_nrad_per_nmm", 1e-9)},
    "tracker-scale": SAME["tracker-scale"],
}
# Effects of which a fault outside the library holds a share, so that to name them is not wrong.
KIN: dict[str, tuple[str, ...]] = {
    "warm-backlash": ("backlash",),
    "cable-drag": ("backlash", "windup"),
    "load-backlash": ("backlash",),
    "stick-slip": ("backlash", "windup"),
    "carriage-tip": ("backlash",),
    "loaded-friction": ("backlash", "windup"),
    "dress-pack": ("backlash", "windup"),
    "loaded-play": ("backlash",),
}
# Variables that a diagnosis may put first, by kind of a fault outside the library; others follow their own slider's
# height or joint's angle.
ANYWHERE = "x y z q1 q2 q3 q4 q5 q6 q7"  # what a lever of gravity follows
LEADS: dict[str, str] = {
    "hose": "x y z",
    "warm-backlash": "temperature time direction{leg}",  # warmth comes with time
    "load-backlash": "payload direction{leg}",
    "cross-coupling": "b{other}",
    "cable-drag": "direction{leg} b{leg}",
    "loose-joint": "x y",
    "settling-table": "x y payload",
    "motor-heat": "time temperature speed{leg}",
    "stick-slip": "direction{leg} speed{leg}",  # short steps are slow ones
    "slipping-coupling": "time direction{leg}",  # reversals so far show as time
    "carriage-tip": "direction{leg} b{leg}",
    "hardening-joint": f"payload {ANYWHERE}",
    "loaded-friction": f"direction{{joint}} payload {ANYWHERE}",
    "slipping-tool": "time temperature",
    "rocking-base": f"payload {ANYWHERE}",
    "dress-pack": "direction{joint} q{joint}",
    "warm-joint": "temperature time",
    "busy-joint": "time temperature speed{joint} q{joint}",
    "coupled-joints": "q{other}",
    "loaded-play": "payload direction{joint}",
    "loss-at-reversal": "time direction{joint}",
}


def judge_names(named: Sequence[Sequence[str]], truth: Truth, drawn: DrawnRig) -> dict[str, Any]:
    """Names against what is hidden.

    Args:
        named: for each step the effects that fit equally well, the pick first.
        truth: what is hidden.
        drawn: the rig.

    Returns:
        `outcome` in one word; `words`, each pick's right, fair, kin, partial or wrong; `explained`, whether a fault
        outside the library is done away with by the names, so that nobody could tell.
    """
    picks = list(dict.fromkeys(group[0] for group in named))
    must, may = {fault.name for fault in truth.faults if fault.counts}, set(truth.hidden)
    judgement = judge(picks, truth)
    kin = {name for key in drawn.truth for name in KIN.get(key, ())}
    words = {
        key: "kin" if word in ("wrong", "partial") and key.partition("[")[0] in kin else word
        for key, word in judgement.named.items()
    }
    open_ = [name for name, word in judgement.faults.items() if word == "missed"]
    return {
        "outcome": _outcome(named, picks, must, may, right=judgement.right),
        "words": words,
        "explained": not any(name in open_ for name in may if not _library_has(name, truth)),
    }


def _outcome(named: Sequence[Sequence[str]], picks: list[str], must: set[str], may: set[str], *, right: bool) -> str:
    if not picks:
        return "silent" if not must else "missed"
    if _fits(picks, must, may):
        return "exact"
    small = [group if len(group) <= GROUP else group[:1] for group in named]
    if right and any(_fits(choice, must, may) for choice in itertools.product(*small)):
        return "declared"
    if right:
        return "fair"
    if must and must <= set(picks):
        return "extra"
    return "missed" if set(picks) <= may else "wrong"


def _fits(picks: Any, must: set[str], may: set[str]) -> bool:
    return must <= set(picks) <= may and len(set(picks)) == len(picks)


def _library_has(name: str, truth: Truth) -> bool:
    return next(fault.known for fault in truth.faults if fault.name == name)


def verdict_right(verdict: str, truth: Truth, explained: bool) -> bool | None:
    """Whether a verdict is right; None where what is hidden is too small for anyone to say."""
    odd = [fault for fault in truth.faults if not fault.known]
    if any(fault.counts for fault in odd):
        return verdict == "unknown" or (explained and verdict == "missing")
    if any(fault.counts for fault in truth.faults):
        return verdict == "missing" if not odd else verdict in ("missing", "unknown")
    return verdict == "nothing-missing" if not truth.faults else None


def statements(result: Mapping[str, Any], words: Mapping[str, str], right: bool | None) -> list[tuple[float, bool]]:
    """Each probability that is stated, and whether what it is stated of is so."""
    said = []
    for candidate in result["candidates"]:
        key = candidate["effect"]
        if candidate.get("probability") is not None and key in words:
            said.append((float(candidate["probability"]), words[key] in ("right", "fair")))
    chance = (result.get("verdict_probability") or {}).get(result["verdict"])
    return [*said, (float(chance), right)] if chance is not None and right is not None else said


def leading(depends_on: Sequence[Mapping[str, Any]], drawn: DrawnRig) -> dict[str, Any] | None:
    """Whether what a rest follows first is what the fault outside the library follows; None without such a fault."""
    odd = [key for key in drawn.truth if faults_of(drawn.rig)[key].section == "odd"]
    if not odd:
        return None
    leads = leads_of(drawn.truth[odd[0]])
    first = depends_on[0]["on"] if depends_on else None
    return {"on": first, "leads": list(leads), "right": first in leads, "near": near(first, leads, drawn)}


def leads_of(fault: Mapping[str, Any]) -> tuple[str, ...]:
    """Variables that a diagnosis may put first where a fault outside the library, as the rig's file states it, is."""
    if "variables" in fault:  # warmth, or a memory of it, shows as warmth or as time
        shown = {"memory": ("temperature", "time"), "temperature": ("temperature", "time")}
        return tuple(dict.fromkeys(name for key in fault["variables"] for name in shown.get(key, (key,))))
    return tuple(LEADS.get(fault["kind"], "b{leg}" if "leg" in fault else "q{joint}").format(**fault).split())


def near(first: str | None, leads: Sequence[str], drawn: DrawnRig) -> bool:
    """Whether a variable runs with a true one through this run so closely that it says the same."""
    if first is None or first in leads:
        return first in leads
    values = _variables(drawn)
    if first not in values:
        return False
    return any(_correlation(values[first], values[name]) > ALIKE for name in leads if name in values)


def _correlation(one: np.ndarray, two: np.ndarray) -> float:
    if one.std() < 1e-12 or two.std() < 1e-12:
        return 0.0
    return float(abs(np.corrcoef(one, two)[0, 1]))


def _variables(drawn: DrawnRig) -> dict[str, np.ndarray]:
    frame = simulate(drawn.rig, drawn.targets, noise=False).frame
    frame = frame[frame["role"] != "base"]
    sent = frame[drawn.rig.commanded].to_numpy(float)
    ways, joints = travel_direction(sent), drawn.rig.sent
    columns = {"payload": "payload_kg", "temperature": "temp_c", "time": "time_s"}
    columns |= {axis: f"{axis}_cmd" for axis in "xyz"}
    values = {name: frame[column].to_numpy(float) for name, column in columns.items()}
    values |= {name: sent[:, joint] for joint, name in enumerate(joints)}
    return values | {f"direction{joint + 1}": ways[:, joint] for joint in range(len(joints))}


def pulls(result: Mapping[str, Any], truth: Truth, drawn: DrawnRig) -> list[tuple[str, float]]:
    """(parameter, (stated - true) / std) of every parameter that is stated with its deviation."""
    found, alike = [], SAME if drawn.rig.serial is None else SAME_OF_ARM
    flipped = {"backlash"} & {
        faults_of(drawn.rig)[key].called for key in drawn.truth if faults_of(drawn.rig)[key].section == "controller"
    }
    for candidate in result["candidates"]:
        effect = candidate["effect"]
        true = next((fault.values for fault in truth.faults if fault.name == effect), None)
        for item in candidate["parameters"] if true is not None and effect in alike else ():
            name, _, number = item["name"].partition(" ")
            value = _true_value(alike[effect], name, number, true)
            if value is not None and item["std"]:
                value = -value if effect in flipped else value  # what the controller adds is a gap below zero
                found.append((f"{effect} {name}", float((item["value"] - value) / item["std"])))
    return found


def _true_value(same: Mapping[str, tuple[str, float]], name: str, number: str, true: Mapping[str, Any]) -> float | None:
    key, factor = same.get(name, ("", 0.0))
    if key not in true:
        return None
    values = np.atleast_1d(true[key])
    index = int(number) - 1 if number.isdigit() else 0
    return factor * float(values[index]) if index < len(values) else None


def reached(model: Model, drawn: DrawnRig, truth: Truth, printed_um: float | None) -> dict[str, Any]:
    """What commands of the model do on the rig, without noise: times the noise, and over what was said of them.

    `rosy` is over the held-out error that the diagnosis prints, `unforeseen` over that and `sigma_um` of the commands,
    which beside base reflectors is of the base frame while the error is not.
    """
    noise = UM_PER_MM * truth.noise.total
    measured = remeasure(model, drawn)
    tool, missed = measured.to_dict(), measured.missed
    before = tool["before"]["total"]
    after = None if tool["after"] is None else tool["after"]["total"]
    found: dict[str, Any] = {"before": before / noise, "after": None if after is None else after / noise}
    found["worse"] = after is not None and after > before + WORSE * noise
    if after is not None and printed_um:
        promised = np.hypot(printed_um, 0.0 if missed is None else UM_PER_MM * rms_length(missed[:, None]))
        shown = np.hypot(after, scatter(drawn))
        found["rosy"] = float(shown / promised)
        sure = 0.0 if measured.sigma is None else UM_PER_MM * rms_length(np.nan_to_num(measured.sigma)[:, None])
        found["unforeseen"] = float(shown / np.hypot(promised, sure))
    return found


def scatter(drawn: DrawnRig) -> float:
    """What noise alone, gross errors left out, put into the readings of this very run, um."""
    noisy, still = (simulate(drawn.rig, drawn.targets, noise=noise) for noise in (True, False))
    shift = noisy.frame[READINGS].to_numpy(float) - still.frame[READINGS].to_numpy(float)
    kept = np.isfinite(shift).all(axis=1) & (noisy.frame["role"] != "base").to_numpy() & ~noisy.outlier
    place = still.truth if drawn.rig.serial is None else still.frame[READINGS].to_numpy(float)
    run, mount = noisy.frame["run"].to_numpy(), mount_columns(drawn)
    held = None if mount is None else mount[kept]
    return UM_PER_MM * rms_length(without_set_up(drawn.rig, shift[kept], place[kept], run[kept], held))


def printed_heldout(result: Mapping[str, Any]) -> float | None:
    """The error that a reader is told to expect, um: held out, and with it what no reading shows of the tool."""
    steps = len(result["suggested"])
    if not steps:
        return None
    last = result["candidates"][steps - 1]
    value = last["heldout_rms_um"]["after"]
    return None if value is None else float(np.hypot(value, last.get("tool_doubt_um") or 0.0))
