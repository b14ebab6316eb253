"""More faults of a 3-PTT that effects of the library describe; `draw_rig` leaves them out, so its seeds stay alike."""

from typing import Any

from ptt.rig.draw_faults import PATH_OR_VOLUME, STATIC, Fault, Random, Scene, log_uniform, some_legs


def _slip(random: Random, scene: Scene) -> dict[str, Any]:
    """The zero of one slider shifts between a fifth and four fifths of the run."""
    leg, size = random.integers(3), log_uniform(random, 0.02, 0.4) * random.choice([-1.0, 1.0])
    slip = [float(size) if other == leg else 0.0 for other in range(3)]
    return {"slip_mm": slip, "slip_share": float(random.uniform(0.2, 0.8))}


def _soft_links(random: Random, scene: Scene) -> dict[str, Any]:
    return {"link_compliance_um_per_n": some_legs(random, 0.03, 0.5, signed=False)}


def _over_compensation(random: Random, scene: Scene) -> dict[str, Any]:
    """A controller that compensates backlash which is not there: a negative gap to the library."""
    return {"backlash_mm": some_legs(random, 0.008, 0.1, signed=False)}


def _scale(random: Random, scene: Scene) -> dict[str, Any]:
    return {"scale_ppm": log_uniform(random, 20.0, 150.0) * float(random.choice([-1.0, 1.0]))}


def _offsets(random: Random, scene: Scene) -> dict[str, Any]:
    return {
        "joint_offset_rail_mm": some_legs(random, 0.02, 0.15),
        "joint_offset_slider_mm": some_legs(random, 0.02, 0.15),
    }


MORE: tuple[Fault, ...] = (
    Fault("homing-slip", "drive", PATH_OR_VOLUME, _slip),
    Fault("link-compliance", "geometry", ("payload",), _soft_links),
    Fault("over-compensation", "controller", PATH_OR_VOLUME, _over_compensation, effect="backlash"),
    Fault("tracker-scale", "tracker", STATIC, _scale),
    Fault("joint-offset", "geometry", STATIC, _offsets),
)
