"""The three files of a C export: tables of the model, then fixed C."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nets import GaussianRbf
from ptt.correct.compensate import LIMIT_MM
from ptt.correct.exports.c.effects import Parts, kernel, parts_of, stage_functions
from ptt.correct.exports.c.numbers import define, table
from ptt.correct.exports.c.tree import tree_order
from ptt.correct.newton import MISSED
from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.dexterity import NEAR_RATIO
from ptt.mechanisms.serial import Serial
from ptt.mechanisms.serial_descent import LONGEST_STEP_RAD, TOLERANCE_MM
from ptt.mechanisms.serial_inverse import middle
from ptt.mechanisms.statics import GRAVITY, gravity_of
from ptt.mechanisms.three_ptt import ThreePtt
from ptt.mechanisms.workspace import NEAR_CONDITION, arm_translation_rank
from ptt.run.table import make_table
from ptt.run.target_frame import target_frames
from ptt.run.travel import TRANSIT_STEPS

if TYPE_CHECKING:
    from ptt.correct.training.compensator import Compensator

NODES = 4  # of a network, computed together (the count is padded to a multiple)
ARM_NOTE = """ An arm
 * takes the posture that is nearest the middle of its limits, as `ptt predict` does; ptt_correct keeps a posture."""
ARM_FUNCTIONS = """
/* Corrected command of nominal joint values: what to send instead of them, in their posture. Codes as ptt_command. */
int ptt_correct(const double nominal[PTT_JOINTS], const ptt_context *context, ptt_state *state, double q[PTT_JOINTS]);
"""
ARM_BODY = """
int ptt_correct(const double nominal[PTT_JOINTS], const ptt_context *context, ptt_state *state, double q[PTT_JOINTS])
{
    double place[3];
    ptt_meet(nominal, 0, place);
    return ptt_row(place, nominal, context, state, 1, q);
}
"""


@dataclass(frozen=True)
class CSource:
    """C of a model.

    Attributes:
        header: ptt_model.h.
        body: ptt_model.c.
        parts: the effects in it, and those that are not.
    """

    header: str
    body: str
    parts: Parts


def source_of(compensator: "Compensator", head: list[str]) -> CSource:
    """Write the C of a model.

    Args:
        compensator: physics, and a network where there is one.
        head: lines for the comment at the top.

    Returns:
        Header and body.
    """
    file = compensator.model.file
    arm = file.machine.kind == "serial"
    parts = parts_of(compensator.model)
    joints = compensator.model.joints
    header = kernel("ptt_model.h.in").replace("@JOINTS@", str(joints)).replace("@LIMIT@", repr(LIMIT_MM))
    header = header.replace("@ARM_NOTE@", ARM_NOTE if arm else "").replace("@ARM_FUNCTIONS@", ARM_FUNCTIONS * arm)
    body = [
        _includes(compensator),
        '#ifndef NAN\n#error "a C99 <math.h> with NAN is needed"\n#endif\n\n',
        _macros(compensator, parts),
        _network(compensator),
        _frame(file),
        kernel("common.c.in"),
        _family(file, parts),
        _effects(parts, arm),
        _reversal(parts, joints, not arm),
        kernel("turns.c.in"),
        kernel("settle_serial.c.in" if arm else "settle_three_ptt.c.in"),
        kernel("network.c.in") if compensator.network is not None else "",
        kernel("command.c.in"),
        ARM_BODY * arm,
    ]
    comment = comment_of(head)
    return CSource(comment + header, comment + "\n".join(part for part in body if part), parts)


def _includes(compensator: "Compensator") -> str:
    more = "#include <float.h>\n#include <stdint.h>\n#include <string.h>\n" if compensator.network is not None else ""
    return f'#include <math.h>\n{more}#include "ptt_model.h"\n\n'


def comment_of(head: list[str]) -> str:
    """Lines as a C comment."""
    return "/*\n" + "".join(f" * {line}\n" for line in head) + " */\n"


def _macros(compensator: "Compensator", parts: Parts) -> str:
    spec = compensator.model.file.machine
    flags = [
        ("PTT_REVERSES", parts.reverses),
        ("PTT_STRAIGHT", parts.reverses and spec.moves == "straight"),
        ("PTT_NEEDS_DRAWING", bool(parts.needs & {"drawing", "force"})),
        ("PTT_NEEDS_FORCE", "force" in parts.needs),
        ("PTT_NETWORK", compensator.network is not None),
        ("PTT_OVER_JOINTS", compensator.network is not None and compensator.space == "joints"),
    ]
    text = "".join(define(name, 1) for name, there in flags if there)
    text += define("PTT_REFERENCE_C", spec.reference_temp_c) + define("PTT_GRAVITY", GRAVITY)
    return text + define("PTT_MISSED", MISSED) + define("PTT_TRANSIT", TRANSIT_STEPS) + "\n"


def _family(file: MachineFile, parts: Parts) -> str:
    mechanism = build_mechanism(file.machine)
    home = table("ptt_home", mechanism.home()) if "ptt_home" in parts.functions else ""
    text = home + table("ptt_travel", mechanism.limits().T.numpy(), note="ends of travel, mm or rad")
    if isinstance(mechanism, ThreePtt):
        return text + _three_ptt(mechanism, file, parts) + "\n" + kernel("three_ptt.c.in")
    assert isinstance(mechanism, Serial)
    return text + _serial(mechanism, file, parts)


def _three_ptt(mechanism: ThreePtt, file: MachineFile, parts: Parts) -> str:
    spec = file.machine
    assert spec.kind == "three-ptt"
    tables = {
        "ptt_foot": (mechanism.foot, "virtual joint centre of each leg at slider height 0, mm"),
        "ptt_rail": (mechanism.rail, "direction of each rail"),
        "ptt_link": (mechanism.link, "link lengths, mm"),
        "ptt_outer": (mechanism.outer_axis, "outer axis of the universal joints, tangential"),
        "ptt_radial": (mechanism.outward, "outward"),
        "ptt_across": (mechanism.across, "across each rail, as its upper end leans outward"),
        "ptt_stand": (mechanism.foot_direction, "outward, of a flat rail across it"),
        "ptt_azimuth": (_azimuth(spec.slider_azimuth_deg), "cosine and sine of each slider's azimuth"),
        "ptt_reflector": (spec.reflector_mm, "mm from the platform's centre"),
    }
    always = ("ptt_foot", "ptt_rail", "ptt_link", "ptt_outer")
    used = [name for name in tables if name in always or name in parts.functions]
    text = "".join(table(name, tables[name][0], note=tables[name][1]) for name in used)
    text += define("PTT_SIDE", mechanism.side) + define("PTT_ABOVE", 1.0 if mechanism.above else -1.0)
    text += define("PTT_SHORTEST", float(mechanism.link.min()))
    text += define("PTT_NEAR", NEAR_RATIO) + define("PTT_PLATFORM_KG", spec.platform_mass_kg)
    text += define("PTT_PLATFORM_MM", spec.platform_radius_mm) + define("PTT_BASE_MM", spec.base_radius_mm)
    return text + define("PTT_LINK_MM", spec.link_length_mm)


def _azimuth(degrees: tuple[float, float, float]) -> np.ndarray:
    angle = np.radians(degrees)
    return np.stack([np.cos(angle), np.sin(angle), np.zeros(3)], axis=1)


def _serial(arm: Serial, file: MachineFile, parts: Parts) -> str:
    spec = file.machine
    assert spec.kind == "serial"
    drawn = np.array([arm.a_mm, arm.alpha_rad, arm.d_mm, arm.offset_rad, np.zeros(arm.joints)]).T
    errors = np.zeros((arm.joints, 5)) if parts.chain is None else parts.chain
    chains = _chain("ptt_drawn", drawn) + _chain("ptt_true", drawn + errors)
    text = table("ptt_tool_point", arm.tool_mm, note="in the last link's frame, mm")
    text += table("ptt_middle", middle(arm), note="rad")
    masses = [(joint.mass_kg or 0.0, joint.com_mm or (0.0, 0.0, 0.0)) for joint in spec.joint]
    if "force" in parts.needs or "ptt_down" in parts.functions:
        text += table("ptt_down", gravity_of(spec), note="direction in which weights pull")
    if "force" in parts.needs and any(mass for mass, _ in masses):
        text += define("PTT_MASSES", 1) + table("ptt_mass", [mass for mass, _ in masses])
        text += table("ptt_com", [centre for _, centre in masses])
    text += define("PTT_STANDARD", int(arm.convention == "standard")) + define("PTT_SMALL", 3)
    text += define("PTT_TOLERANCE", TOLERANCE_MM) + define("PTT_LENGTH", arm.length_mm)
    text += define("PTT_LONGEST", LONGEST_STEP_RAD) + define("PTT_CONDITION", NEAR_CONDITION)
    text += define("PTT_WAYS", arm_translation_rank(arm))
    return text + "\n" + kernel("serial.c.in").replace("@CHAINS@", chains)


def _chain(name: str, rows: np.ndarray) -> str:
    """Links as (a, cos alpha, sin alpha, d, turn, cos beta, sin beta)."""
    a, alpha, d, turn, beta = rows.T
    values = np.stack([a, np.cos(alpha), np.sin(alpha), d, turn, np.cos(beta), np.sin(beta)], axis=1)
    return table(name, values).replace(f"double {name}[{len(rows)}][7]", f"ptt_joint {name}[PTT_JOINTS]")


def _effects(parts: Parts, arm: bool) -> str:
    title = "/* ---- effects: tables of what was fitted, then what each does " + "-" * 52 + " */\n\n"
    return (
        title
        + parts.tables
        + "\n"
        + parts.functions
        + "\n"
        + stage_functions(parts.calls, ("drive", "structure") if arm else ("drive", "geometry", "structure"))
    )


def _reversal(parts: Parts, joints: int, three: bool) -> str:
    if not parts.reverses:
        return kernel("steady.c.in") + ("" if three else "\n" + kernel("held.c.in"))
    height, length = (np.zeros(joints), np.ones(joints)) if parts.windup is None else parts.windup
    text = table("ptt_gap", np.zeros(joints) if parts.gap is None else parts.gap, note="backlash gap_mm or gap_rad")
    text += table("ptt_windup", height, note="windup height")
    if parts.windup is not None:
        text += table("ptt_windup_length", length, note="travel over which it changes") + define("PTT_WINDS", 1)
    if not parts.waits:
        text += define("PTT_AT_ONCE", 1)
    return text + "\n" + kernel("reversal.c.in") + ("\n" + kernel("ahead.c.in") if three else "")


def _network(compensator: "Compensator") -> str:
    network = compensator.network
    if network is None:
        return ""
    domain = network.domain
    points = domain.points[tree_order(domain.points)]
    text = define("PTT_INPUTS", network.inputs) + define("PTT_POINTS", len(points))
    text += define("PTT_REACH", domain.reach) + define("PTT_ROOM", domain.room)
    text += table("ptt_mean", network.input_mean) + table("ptt_scale", network.input_scale)
    text += table("ptt_box", np.stack([domain.low, domain.high])) + table("ptt_points", points, note="k-d order")
    return text + _nodes(network)


def _nodes(network: GaussianRbf) -> str:
    centres, widths = network.centres.numpy(), network.widths.numpy()
    weights = network.weights.detach().numpy()
    idle = -len(centres) % NODES if len(centres) else NODES  # nodes of no weight; C has no empty arrays
    centres = np.concatenate([centres, np.zeros((idle, network.inputs))])
    weights = np.concatenate([weights, np.zeros((idle, 3))])
    sharp = -0.5 / np.concatenate([widths, np.ones(idle)]) ** 2
    text = define("PTT_NODES", len(centres)) + table("ptt_sharp", sharp, note="-1/(2 width^2)")
    text += table("ptt_level", sharp * (centres**2).sum(axis=1)) + table("ptt_toward", -2.0 * sharp * centres.T)
    text += table("ptt_weight", weights.T)
    slope, threshold = network.slope.detach().numpy(), network.threshold.detach().numpy()
    return text + table("ptt_slope", slope) + table("ptt_threshold", threshold) + "\n"


def _frame(file: MachineFile) -> str:
    (frame,) = target_frames(file, make_table(np.zeros((1, 3))))
    if frame.source == "base":
        return ""
    text = define("PTT_FRAME", 1) + table("ptt_turn", frame.rotation, note="from the frame that targets are stated in")
    return text + table("ptt_origin", frame.origin)
