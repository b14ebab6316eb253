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
}
