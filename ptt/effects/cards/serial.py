"""Cards of the geometry effects of serial arms."""

from ptt.effects.cards.card import Card

CARDS: dict[str, Card] = {
    "joint-error-map": Card(
        cause="The encoder ring or the strain-wave gear of a joint is uneven, so the joint errs alike at every turn.",
        equation="dq_i = sum over m = 1..64 of a_im cos(m q_i) + b_im sin(m q_i), each amplitude held near zero",
        source=(
            "positioning error of a rotary axis: ISO 230-2; kinematic error of strain-wave gears: Ghorbel, Gandhi and "
            "Alpeter, J. Mechanical Design 123, 2001"
        ),
        size="1e-4 rad a harmonic up to about the thirtieth",
        fingerprint="J e of a joint against its angle: one wavy curve, the same at every turn and in every pose.",
        confused_with=(
            ("once-per-rev", "its first harmonic alone: joint angles spread over the turn"),
            ("dh-offsets", "a link's first harmonic in a lone joint: poses that vary all joints"),
            ("axis-compliance", "follows load, not angle: repeat under another payload"),
        ),
        remedy="Calibrate the joint against a reference encoder, or command corrected joints.",
        needs="several hundred poses spread over the joint angles",
        telling="b",
    ),
    "dh-offsets": Card(
        cause="Links and joint axes are not where the drawing has them: machining, assembly, encoder zeros.",
        equation=(
            "dp = sum over links of (dp/da da + dp/dalpha dalpha + dp/dd dd + dp/dtheta dtheta + dp/dbeta dbeta), "
            "carried by the exact chain; beta, a rotation about y behind the twist, between parallel axes only"
        ),
        source=(
            "Hui Jizhuang et al., Mechanical Engineering and Technology 5(4), 2016, eq. 7; parallel axes: Hayati and "
            "Mirmirani, J. Robotic Systems 2, 1985"
        ),
        size="a and d 0.1 to 1 mm, angles 0.1 to 5 mrad",
        fingerprint="A field that is smooth in the joint values, with periods of one turn of each joint.",
        confused_with=(
            ("homing-offset", "is the dtheta of every joint, so only one of the two goes in"),
            ("tracker-frame", "first link and joint one is a moved base: base reflectors"),
            ("reflector mount", "last link and joint is a moved reflector: a second mount, or turns of the last joint"),
            ("axis-compliance", "gravity bends alike in the same poses: repeat under another payload"),
        ),
        remedy="Enter the measured Denavit-Hartenberg parameters in the controller, or command corrected joints.",
        telling="b",
        shade="z",
    ),
    "self-weight": Card(
        cause="Gears and bearings of the joints yield under the weight of the arm's own links.",
        equation=(
            "dq_j = c_j g_j(q), g_j = gamma . (z_j x sum over the links l behind of (X_l x_l + Y_l y_l)): gamma the "
            "direction of gravity, z_j the joint's axis, x_l the link's common normal, y_l across it, X_l and Y_l the "
            "link's base moments times g"
        ),
        source=(
            "joint compliance under gravity: Tenhumberg and Baeuml, IEEE-RAS Humanoids 2021; base parameters of "
            "gravity: Khalil and Dombre, Modeling, Identification and Control of Robots, 2002, ch. 9"
        ),
        size="0.1 to 1 mrad on industrial arms, 10 mrad on light ones",
        fingerprint="J e of a joint follows the lever of what hangs on it: large with the arm stretched out level.",
        confused_with=(
            (
                "dh-offsets",
                "an offset moves with the joint alone, sag with the pose against gravity: poses that vary both",
            ),
            ("axis-compliance", "is the same where the drawing states all masses; a payload moves only that one"),
            ("joint-error-map", "follows one joint's angle, whatever the others do: poses that vary all joints"),
        ),
        remedy="Command corrected joints, or stiffen and counterbalance the joint.",
        needs="poses that turn the arm against gravity",
        telling="b",
        shade="z",
    ),
}
