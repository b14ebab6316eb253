"""Cards of the structure and metrology effects."""

from ptt.effects.cards.card import Card

RIGID = "small rigid motion, Rodrigues' formula to first order"

CARDS: dict[str, Card] = {
    "column-bend": Card(
        cause="Column or frame bends sideways under the payload, more the higher the sliders carry it.",
        equation="dp = m (u + v (mean(q) - q0)), u and v horizontal, m the payload, q0 the mean height at p = 0",
        source="linear elasticity, first order in height",
        size="0.001 to 0.005 mm/kg",
        fingerprint="A sideways shift proportional to payload, the same everywhere in x and y, changing with height.",
        confused_with=(
            ("axis-compliance", "varies over x and y and sags in z: one payload at poses spread wide"),
            ("tower-tilt", "does not follow payload: repeat under another payload"),
            ("setup-jump", "a tripod that moved while the payload was changed: revisit an unloaded datum"),
        ),
        remedy="Brace the column; keep payloads alike, or correct by payload.",
        needs="payload_kg with at least two loads",
        residual="x",
        telling="payload",
        shade="z",
    ),
    "frame-growth": Card(
        cause="Frame and links grow as they warm; each with its own material.",
        equation=(
            "dp = f(q; R (1 + a_R dT), L (1 + a_L dT)) - f(q; R, L), R the base radius, L the links (serial: every a, "
            "every d), f the forward kinematics"
        ),
        source="linear thermal expansion (steel 11 to 12, aluminium 23 um/m/K); method of ISO 230-3",
        size="0.005 to 0.007 mm at 2 K",
        fingerprint="A drift, mostly in z, shaped like a link or radius error, in step with temperature.",
        confused_with=(
            ("tracker-drift", "moves fixed reflectors too: read base reflectors through the run"),
            ("screw-growth", "a line in height for each slider: poses over the whole travel, warm and cold"),
            ("radius against link", "nearly one pattern in a small volume: poses wide in x and y"),
        ),
        remedy="Hold the room steady, warm up, shield from sun and draught; correct by a frame temperature sensor.",
        needs="temp_c with a change of temperature",
        residual="z",
        telling="temperature",
        shade="radius",
    ),
    "tracker-frame": Card(
        cause="The frame the readings are in is not the base frame: registration of the tracker.",
        equation="dp = t + w x p",
        source=RIGID,
        size="0.02 to 1 mm, 0.1 to 1 mrad",
        fingerprint="The whole field moves and turns like a rigid body.",
        confused_with=(
            ("homing-offset", "common zero is z: base reflectors"),
            ("tower-position", "common sideways is x, y; common tangential a turn about z: base reflectors"),
            ("tower-tilt", "common lean with matching zeros is a turn about x, y: base reflectors"),
        ),
        remedy='Nothing on the machine: measure reflectors fixed to the base and use frame = "measured".',
        residual="x",
        telling="y",
        shade="z",
    ),
    "tracker-scale": Card(
        cause="The tracker's unit of length is off: wrong air temperature, pressure or humidity.",
        equation="dp = s p, about the base origin",
        source="refractive index of air: Edlen, Metrologia 2, 1966 (about 1 ppm/K and 0.27 ppm/hPa)",
        size="1 ppm/K; 1 to 20 ppm",
        fingerprint="All distances long by the same share: error radial, growing with distance.",
        confused_with=(
            ("link-length + tower-position + lead-scale + homing-offset", "together exactly that: read a scale bar"),
            ("frame-growth", "follows the machine's temperature: read a scale bar cold and warm"),
        ),
        remedy="Nothing on the machine: set the tracker's weather station right, read a calibrated scale bar.",
        residual="x",
        telling="x",
    ),
    "tracker-drift": Card(
        cause="Tripod or floor settles, or the tracker is still warming up, so its station wanders.",
        equation="dp = a (1 - exp(-t/T))/(1 - exp(-D/T)), D the run's length; T = 1000 D is a straight line a t/D",
        source="first-order settling",
        size="0.005 to 0.05 mm/h",
        fingerprint="A smooth trend with time in x, y or z, the same at every pose; seen in datum revisits.",
        confused_with=(
            ("frame-growth", "fixed reflectors stand still: read base reflectors, give temp_c"),
            ("screw-growth", "a slope in slider height: poses in random order, a datum every 20 points"),
            ("setup-jump", "at once, not slowly: revisit a datum every 20 points"),
        ),
        remedy="Nothing on the machine: warm the tracker up, stand it firmly, revisit a datum, re-register.",
        needs="time_s over more than an instant",
        residual="x",
        telling="time",
    ),
    "setup-jump": Card(
        cause="The tripod was knocked, or the tracker was set up anew without registration.",
        equation=(
            "dp = t + w x p after a moment, zero until then (seconds, or rows where there is no clock): six free "
            "numbers and a moment that is searched, so it can imitate much that begins part-way"
        ),
        source=RIGID,
        size="0.01 to 0.5 mm",
        fingerprint="From one row on the whole field is shifted and turned; repeats before and after disagree.",
        confused_with=(
            ("tracker-drift", "slow, not at once: a datum every 20 points"),
            ("homing-slip", "one slider's zero moves, base reflectors stay: read base reflectors, revisit a datum"),
            ("poor repeatability", "scatter without order in time: keep the rows in the order of measuring"),
        ),
        remedy="Nothing on the machine: register again, or give the rows after the knock their own run.",
        needs="time_s or rows in order of measuring, at least 20",
        residual="x",
        telling="time",
    ),
}
