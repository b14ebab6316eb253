"""Faults outside the library that are held back from the development of the diagnosis, to judge it by."""

import itertools
from collections.abc import Callable
from typing import Any

from ptt.rig.draw_faults import PATH_OR_VOLUME, STATIC, Fault, Random, Scene, log_uniform
from ptt.rig.draw_odd import log_signed, some_height, some_leg

# Variables of random laws: of every run, and besides of the runs of a protocol.
ALWAYS = ("b1", "b2", "b3", "x", "y", "z", "direction1", "direction2", "direction3", "time")
BESIDES = {"payload": ("payload",), "warmup": ("temperature", "memory"), "speed": ("speed1", "speed2", "speed3")}
FIXED_SPANS = {"payload": (0.0, 6.0), "temperature": (20.0, 28.0), "memory": (20.0, 28.0), "time": (0.0, 1.0)}
SLOW = {"payload", "temperature", "memory", "time"}  # effects of the library follow any function of these alone
HOW_MANY = (1, 1, 2, 2, 3)  # numbers of variables of a random law, equally likely


def _clamp(random: Random, scene: Scene) -> dict[str, Any]:
    high = scene.span[1]
    low = some_height(random, scene, 20.0)
    way = str(random.choice(["radial", "tangential"]))
    slope = log_signed(random, 30.0, 150.0) / (high - low)
    return {"kind": "loose-clamp", "leg": some_leg(random), "height_mm": low, "um_per_mm": slope, "direction": way}


def _motor(random: Random, scene: Scene) -> dict[str, Any]:
    """8 to 40 um for each mm/s of mean speed, of which a run with dwells has a few."""
    size = log_signed(random, 8.0, 40.0)
    return {
        "kind": "motor-heat",
        "leg": some_leg(random),
        "um_s_per_mm": size,
        "constant_s": float(random.uniform(200, 2000)),
    }


def _pitch(random: Random, scene: Scene) -> dict[str, Any]:
    """A pitch that is no simple fraction of the screw's lead."""
    lead = scene.spec.screw_lead_mm or 5.0
    pitch = lead * float(
        random.choice([random.uniform(0.21, 0.24), random.uniform(0.27, 0.31), random.uniform(0.4, 0.47)])
    )
    phase = float(random.random())
    return {
        "kind": "scale-pitch",
        "leg": some_leg(random),
        "pitch_mm": pitch,
        "size_um": log_uniform(random, 8.0, 25.0),
        "phase": phase,
    }


def _stick(random: Random, scene: Scene) -> dict[str, Any]:
    step = scene.scale * log_uniform(random, 3.0, 20.0)
    return {"kind": "stick-slip", "leg": some_leg(random), "size_um": log_uniform(random, 20.0, 100.0), "step_mm": step}


def _coupling(random: Random, scene: Scene) -> dict[str, Any]:
    return {"kind": "slipping-coupling", "leg": some_leg(random), "um_per_reversal": log_signed(random, 0.3, 2.0)}


def _tip(random: Random, scene: Scene) -> dict[str, Any]:
    way = str(random.choice(["radial", "tangential"]))
    return {
        "kind": "carriage-tip",
        "leg": some_leg(random),
        "size_um": log_signed(random, 30.0, 120.0),
        "direction": way,
    }


def _law(acts: str, form: str) -> Callable[[Random, Scene], dict[str, Any]]:
    """The draw of a random law that acts on a slider, a rail, a link, the tool or the line of sight."""

    def draw(random: Random, scene: Scene) -> dict[str, Any]:
        place, leg = _place(acts, random)
        names = (*ALWAYS, *BESIDES.get(scene.protocol, ()))
        while True:
            chosen = random.choice(names, random.choice(HOW_MANY), replace=False).tolist()
            if not describable(place, leg, form, chosen):
                break
        return {
            "kind": "random-law",
            "place": place,
            **({} if leg is None else {"leg": leg}),
            "form": form,
            "variables": chosen,
            "span": [_span(name, scene) for name in chosen],
            "size_um": log_uniform(random, 8.0, 40.0),
            "law_seed": int(random.integers(10**6)),
        }

    return draw


def describable(place: str, leg: int | None, form: str, variables: list[str]) -> bool:
    """Whether effects of the library could describe a random law.

    Args:
        place: where it acts, as in RandomLaw.
        leg: its leg, None where it acts on tool or sight.
        form: smooth or jumpy.
        variables: names of its variables.

    Returns:
        True for laws that are not to be hidden as unknown ones.
    """
    if set(variables) <= SLOW:
        return True  # loads, warmth, drift, knocks, slipped zeros
    if leg is None or len(variables) > 1:
        return False
    (name,) = variables
    own = {f"b{leg}"} if form == "smooth" else set()  # screw map, straightness
    if place in ("along", "link"):
        own |= {f"direction{leg}", f"speed{leg}"}  # backlash, following error
    return name in own


def _place(acts: str, random: Random) -> tuple[str, int | None]:
    if acts in ("tool", "sight"):
        return f"{acts}-{'xyz'[random.integers(3)]}", None
    way = str(random.choice(["radial", "tangential"]))
    return {"slider": "along", "link": "link", "rail": way}[acts], some_leg(random)


def _span(name: str, scene: Scene) -> list[float]:
    if name in FIXED_SPANS:
        return list(FIXED_SPANS[name])
    if name.startswith("direction"):
        return [-1.0, 1.0]
    if name.startswith("speed"):
        return [-40.0, 40.0]
    if name.startswith("b"):
        return scene.span
    half = float(scene.half_size["xyz".index(name)])
    return [-half, half]


ACTS = ("slider", "rail", "link", "tool", "sight")
LAWS = tuple(
    Fault(
        f"random-{acts}-{form}", "odd", (*PATH_OR_VOLUME, "payload", "warmup", "speed"), _law(acts, form), unseen=True
    )
    for acts, form in itertools.product(ACTS, ("smooth", "jumpy"))
)
UNSEEN_FAULTS: tuple[Fault, ...] = (
    Fault("loose-clamp", "odd", STATIC, _clamp, unseen=True),
    Fault("motor-heat", "odd", ("volume", "speed"), _motor, unseen=True),
    Fault("scale-pitch", "odd", STATIC, _pitch, unseen=True),
    Fault("stick-slip", "odd", PATH_OR_VOLUME, _stick, unseen=True),
    Fault("slipping-coupling", "odd", STATIC, _coupling, unseen=True),
    Fault("carriage-tip", "odd", STATIC, _tip, unseen=True),
    *LAWS,
)
