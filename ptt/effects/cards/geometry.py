"""Cards of the geometry effects of the 3-PTT."""

from ptt.effects.cards.card import Card

CLOSURE = "first-order geometry: derivative of |p - c_i| = L_i"

CARDS: dict[str, Card] = {
    "tower-position": Card(
        cause="A rail, its slider joint or its platform joint stands off from the drawing; the two joints count alike.",
        equation="dc_i = a_i u_i + b_i t_i (u_i outward, t_i along increasing azimuth); J_i dp = s_i . dc_i/w_i",
        source=f"{CLOSURE}; calibration of parallel robots: Vischer and Clavel, Robotica 16, 1998",
        size="0.1 to 0.5 mm",
        fingerprint="J e of leg i follows the horizontal reach of its link over its drop, q_i/w_i.",
        confused_with=(
            ("tracker-frame", "common sideways is tracker x, y; common tangential a turn about z: base reflectors"),
            ("link-length", "common radius and common length are 0.998 alike: poses wide in x and y, a measured link"),
            ("platform joint position", "only the difference of the two counts: a coordinate measuring machine"),
        ),
        remedy="Shim or dowel the rail foot, or enter the true radius and azimuth of each leg in the controller.",
        telling="x",
        shade="y",
    ),
    "tower-tilt": Card(
        cause="A rail leans: its foot and head are not one above the other.",
        equation="dc_i = (q_i - q0_i) (a_i u_i + b_i t_i), pivot at q0, angles in rad",
        source=f"{CLOSURE}; the cosine of the lean (under 0.3 um at 2 mrad) is left out",
        size="0.1 to 2 mrad",
        fingerprint="A tower-position error that grows linearly with the slider's height and changes sign at q0.",
        confused_with=(
            ("tracker-frame", "common lean with matching zeros is a turned tracker: base reflectors"),
            ("lead-scale", "not weighted by q_i/w_i: poses wide in x and y"),
            ("column-bend", "follows payload: repeat under another payload"),
        ),
        remedy="Shim the rail against a square or a level; else enter the lean in the machine file (slider_lean_deg).",
        telling="b",
        shade="x",
    ),
    "link-length": Card(
        cause="A link is longer or shorter between its joint centres than drawn.",
        equation="dL_i = l_i; J_i dp = L_i dL_i/w_i",
        source=f"{CLOSURE}; calibration of parallel robots: Vischer and Clavel, Robotica 16, 1998",
        size="all links 0.05 to 0.5 mm; one against the others 0.02 to 0.2 mm",
        fingerprint="All alike: a dish, mostly in z. One: like that leg's zero, with curvature in x and y.",
        confused_with=(
            ("homing-offset", "that leg's zero has no curvature: poses wide in x and y"),
            ("tower-position", "common radius, 0.998 alike: measure one link on a coordinate measuring machine"),
            ("tracker-scale", "with radius, lead and zero it imitates a long tracker: read a scale bar"),
        ),
        remedy="Pair links of equal length, or enter the measured lengths in the controller.",
        telling="link angle",
    ),
    "guide-straightness": Card(
        cause="The rail is bowed or its bolts pull it, so the slider wanders sideways as it travels.",
        equation=(
            "dc_i = u_i f_i(x) + t_i g_i(x), f and g = sum_j a_j N_j(x) + b (2 x - 1) + c with the shapes N_j of "
            "screw-error-map, x = (q_i - from_i)/(to_i - from_i) held to 0..1; b and c are held near zero, because "
            "level and slope are tower-position and tower-tilt"
        ),
        source=f"straightness of a linear motion: ISO 230-1; {CLOSURE}",
        size="0.005 to 0.03 mm",
        fingerprint="Smooth curve in the slider's height, weighted by q_i/w_i, so it turns over across the workspace.",
        confused_with=(
            ("screw-error-map", "not weighted by q_i/w_i: poses wide in x and y, or a linear scale"),
            ("tower-tilt", "a straight line in height: heights over the whole travel, reflector on the slider"),
            ("any smooth rest", "stands in for whatever is missing: add payload and thermal effects first"),
        ),
        remedy="Realign the rail against a straight-edge, bolt in the maker's order; else map it.",
        telling="b",
        shade="x",
    ),
    "joint-offset": Card(
        cause="The two axes of a universal joint do not meet, so the link's length varies with its angle.",
        equation="dL_i = a_i |s_i . rail_i|/L_i + c_i sqrt(1 - (s_i . t_i/L_i)^2)",
        source=CLOSURE,
        size="0.01 to 0.1 mm",
        fingerprint="Link length that follows the link's angle; the rail part is exactly a homing offset.",
        confused_with=(
            ("homing-offset", "the rail part is the same thing: no pose tells; measure the joint on the bench"),
            ("link-length", "the tangential part is 99 % a length: poses rich in sideways link angle"),
        ),
        remedy="Replace the joint; or leave it to homing-offset and link-length, which carry nearly all of it.",
        telling="link angle",
    ),
    "joint-clearance": Card(
        cause="Play in the pins of a leg's joints; they rest on the side that the link force pushes to.",
        equation=(
            "dL_i = (c_i/2) sign(F_i), F_i the pull in the link that holds platform and payload: "
            "sum_i F_i s_i/L_i = (0, 0, -m g)"
        ),
        source="statics of the platform; contact on the loaded side",
        size="0.005 to 0.05 mm",
        fingerprint="A step where a link force changes sign, outside the triangle of the joints; poor repeats there.",
        confused_with=(
            ("backlash", "follows direction, not force: a linear scale and the tracker at once"),
            ("axis-compliance", "grows with load: load and unload through several payloads"),
        ),
        remedy="Preload the joints with springs, replace pins; or work inside the triangle with a load on.",
        needs="platform_mass_kg or payload_kg, and poses on both sides of where a link force changes sign",
        telling="link force",
    ),
    "link-compliance": Card(
        cause="A link and the bearings of its joints stretch under the pull of platform and payload.",
        equation="dL_i = c_i F_i, F_i the pull in the link: sum_i F_i s_i/L_i = (0, 0, -m g), m platform and payload",
        source="statics of the platform; axial stiffness E A/L in series with the joints' bearings",
        size="10 to 100 N/um: 0.5 to 5 um at 50 N",
        fingerprint="The platform hangs lower with payload, and J e of a leg follows the pull in its link.",
        confused_with=(
            ("axis-compliance", "like it times (L/w)^2: payloads at poses spread wide, a linear scale on the axis"),
            ("joint-clearance", "a step, not a slope: load and unload through several payloads"),
            ("link-length", "does not follow payload: repeat under another payload"),
        ),
        remedy="Stiffer links and joint bearings; keep payloads alike, or correct by payload.",
        needs="platform_mass_kg or payload_kg, so that the pull in a link varies over pose or payload",
        telling="link force",
        shade="payload",
    ),
    "platform-twist": Card(
        cause="The joint axes on slider and platform are not parallel, so the platform turns a little as it moves.",
        equation=(
            "(s_i - (s_i . e_i) e_i) . w = -s_i . (e_i x d_i), e_i the slider's joint axis, d_i = a_i u_i + b_i z the "
            "platform's less it; platform joints B_i: dc_i = -w x B_i; reflector: dp = w x reflector_mm"
        ),
        source="first order of s_i . (e_i x R e'_i) = 0, universal joints with parallel middle axes",
        size="0.1 to 2 mrad",
        fingerprint="A smooth field that grows with the reflector's distance from the platform's centre.",
        confused_with=(
            ("reflector_mm", "a wrong offset is constant in the base frame: three reflectors on the platform at once"),
            ("tower-position", "does not grow with the reflector's offset: repeat with the reflector elsewhere"),
        ),
        remedy="Ream or shim the joint seats parallel; put the reflector and the tool at the platform's centre.",
        telling="y",
        residual="x",
        shade="x",
    ),
}
