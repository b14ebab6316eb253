"""Cards of the drive effects."""

from ptt.effects.cards.card import Card

SCREW_STANDARD = "ISO 3408-3 (ball screws, tolerance classes)"

CARDS: dict[str, Card] = {
    "homing-offset": Card(
        cause="The reference switch or index mark of an axis is not where the drawing has its zero.",
        equation="dq_i = c_i",
        source="first-order geometry: J dp = dq",
        size="0.05 to 1 mm",
        fingerprint="A constant in J e, one for each slider; changes by a jump each time the machine is homed.",
        confused_with=(
            ("tracker-frame", "the common part is tracker z: base reflectors, or a height gauge on the base"),
            ("link-length", "one leg's length is like its zero: poses far out in x and y, where curvature shows"),
            ("joint-offset", "its rail part is the same thing: no tracker can tell; a linear scale on the axis can"),
        ),
        remedy="Enter the offset in the controller's homing table, or shift the switch or the index mark.",
    ),
    "homing-slip": Card(
        cause="An axis was homed anew, hit a stop, or its coupling or belt slipped: its zero moved during the run.",
        equation="dq_i = c_i after a moment, zero until then (seconds, or rows where there is no clock)",
        source="first-order geometry: J dp = dq",
        size="0.01 to 0.5 mm",
        fingerprint="From one row on J e of a slider has another level; the other sliders and base reflectors stay.",
        confused_with=(
            ("setup-jump", "moves every reflector like a rigid body: read base reflectors, revisit a datum"),
            ("homing-offset", "is there from the first row: keep the rows in the order of measuring"),
            ("screw-growth", "comes slowly, with warmth: a datum every 20 points, a temp_c column"),
        ),
        remedy="Tighten coupling and clamps, home again, measure again; the model serves from the slip on.",
        needs="time_s or rows in order of measuring, at least 20",
        telling="time",
    ),
    "lead-scale": Card(
        cause="The lead of the screw, or the controller's counts per mm, is off by a constant share.",
        equation="dq_i = k_i (q_i - q0_i), q0 the joint value at p = 0",
        source=f"{SCREW_STANDARD}: mean travel deviation; first-order geometry",
        size="C5 screw 0.023 mm per 315 mm, a share of 7e-5",
        fingerprint="J e of the slider is a straight line in its height, through zero at q0.",
        confused_with=(
            ("screw-growth", "the slope follows temperature: measure cold and warm with a temp_c column"),
            ("tracker-scale", "with links, radius and zero it imitates a long tracker: read a scale bar"),
            ("tower-tilt", "a lean is weighted by q_i/w_i, a lead is not: poses wide in x and y, a linear scale"),
        ),
        remedy="Correct counts per mm in the controller (multiply by 1/(1 + k)).",
    ),
    "screw-error-map": Card(
        cause="The lead varies along the screw: rolled or worn thread, bent shaft, end bearings out of line.",
        equation=(
            "dq_i = sum_j a_ij N_j(x) + b_i (2 x - 1) + c_i, x = (q_i - from_i)/(to_i - from_i) held to 0..1; N_j the "
            "15 bending modes of a natural cubic spline on 17 knots, the first one high, the j-th about 1/j^2 (the "
            "prior of a smoothing spline); b and c, what a curve leaves of slope and level over the visited heights, "
            "are held near zero"
        ),
        source=(
            f"{SCREW_STANDARD}: travel variation; the form of a controller's leadscrew compensation table; shapes: "
            "Wahba, Spline Models for Observational Data, 1990"
        ),
        size="0.005 to 0.02 mm",
        fingerprint="J e of one slider is a smooth curve in its own height, the same at every x and y.",
        confused_with=(
            ("guide-straightness", "enters weighted by q_i/w_i: poses wide in x and y, or a linear scale on the axis"),
            ("link-length", "curvature in x and y, not in height alone: poses at one height, wide in x and y"),
        ),
        remedy="Load the curve as the axis's compensation table; replace the screw if it is worn.",
    ),
    "once-per-rev": Card(
        cause="The screw wobbles or its coupling or encoder is eccentric, so the error repeats with every turn.",
        equation="dq_i = a_i cos(2 pi q_i/T) + b_i sin(2 pi q_i/T), T = lead (label 'harmonic m': T = lead/m)",
        source=f"{SCREW_STANDARD}: travel variation within 2 pi",
        size="0.003 to 0.008 mm (one turn: C3 0.006, C5 0.008)",
        fingerprint="A line at 1/lead in the spectrum of J e against the slider's height, perhaps with harmonics.",
        confused_with=(
            ("homing-offset", "heights whole leads apart show a constant: heights not commensurate with the lead"),
            ("screw-error-map", "steps above half the lead alias it to a slow curve: steps under half the lead"),
        ),
        remedy="Realign coupling and encoder, straighten the screw; or put the harmonic in the compensation table.",
        needs="screw_lead_mm (gear_period_rad) in the machine file, and heights not commensurate with it",
        telling="phase",
    ),
    "backlash": Card(
        cause="Play between nut and screw, or a loose thrust bearing: after a reversal the slider waits for the gap.",
        equation=(
            "y = min(max(y_before, q - e_i/2), q + e_i/2), dq_i = y - q: -e_i/2 in the direction of travel once the "
            "gap is taken up, between the branches before; a run's first row is taken to arrive as its second moves; "
            "below zero (a controller that compensates more than there is): -e_i/2 in the direction of travel, at once"
        ),
        source="play operator: Visintin, Differential Models of Hysteresis, 1994; Chen Mingfang et al. 2023, eq. 19",
        size="rolled screw 0.05 to 0.2 mm; preloaded C5 0.008 to 0.015 mm",
        fingerprint="J e falls on two parallel branches, e apart, by the direction in which the slider arrived.",
        confused_with=(
            ("windup", "changes over gradually: readings within a few mm of a reversal, and far from it"),
            ("joint-clearance", "follows the link force, not the direction: a linear scale and the tracker at once"),
            ("following-error", "gone at standstill: dwell before reading"),
        ),
        remedy=(
            "Preload or replace the nut, tighten the thrust bearing; else reversal compensation in the controller. "
            "Below zero: lower the controller's reversal compensation by as much."
        ),
        needs="poses reached from both directions",
        shade="direction",
    ),
    "windup": Card(
        cause="Friction in guide and nut twists screw and coupling until it is overcome, at each reversal.",
        equation="dq_i = -h_i F, dF/dx = (sign(dx) - F)/l along the travel x; fully turned before a run's first row",
        source="Dahl, A Solid Friction Model, The Aerospace Corporation, 1968",
        size="0.001 to 0.01 mm over 1 to 10 mm of travel",
        fingerprint="Two branches by direction that grow into each other over the first millimetres after a reversal.",
        confused_with=(
            ("backlash", "opens at once when the gap is taken up: short against long travel after a reversal"),
            ("axis-compliance", "follows payload, not direction: repeat under another payload"),
        ),
        remedy="Lubricate, relieve the preload, stiffen the coupling; overtravel and return from one side always.",
        needs="poses from both directions, some within a few mm of the reversal",
        telling="travel",
        shade="direction",
    ),
    "following-error": Card(
        cause="The position loop lags behind a moving command, and the reading is taken on the move.",
        equation="dq_i = -v_i tau_i, v_i from the feed and the path, else from the time stamps",
        source="velocity lag of a proportional position loop: tau = 1/K_v",
        size="v/K_v: 0.67 mm at 20 mm/s and K_v = 30/s; none at standstill",
        fingerprint="J e is proportional to the slider's velocity and points backward along the path.",
        confused_with=(
            ("backlash", "both change sign with direction: two speeds, or dwell before reading"),
            ("tracker-drift", "a late trigger of the tracker looks the same: check the trigger at standstill"),
        ),
        remedy="Dwell before reading; raise the loop gain or use velocity feed-forward.",
        needs="two or more speeds (feed_mm_s, or time_s while moving)",
        telling="speed",
    ),
    "screw-growth": Card(
        cause="The screw warms and grows away from its fixed bearing.",
        equation="dq_i = a_i dT (q_i - q0_i) + d_i dT, dT = temp_c - reference_temp_c; d carries the unknown fixed end",
        source="linear thermal expansion (steel 11 to 12 um/m/K); method of ISO 230-3",
        size="0.035 mm at 300 mm and 10 K",
        fingerprint="The slope of J e against height drifts with temperature, more where the axis works most.",
        confused_with=(
            ("lead-scale", "does not follow temperature: measure cold and warm"),
            ("tracker-drift", "follows time, not temperature: revisit a datum, read base reflectors"),
            ("frame-growth", "a dish or a radius, not a line in height: poses over the whole volume, warm and cold"),
        ),
        remedy="Warm up before work, cool the screw, fit linear scales, or correct by a screw temperature sensor.",
        needs="temp_c with a change of temperature",
        telling="temperature",
        shade="b",
    ),
    "axis-compliance": Card(
        cause="Nut, bearing and screw yield under the load of the axis.",
        equation="dq_i = c_i f_i; f from tau columns, else f = (dp/dq)^T F with F = (0, 0, -m g), m the payload",
        source="virtual work; stiffness mapping: Gosselin, IEEE Trans. Robotics and Automation 6(3), 1990",
        size="2 to 50 N/um; 5 kg at x = 60 mm and 5 N/um: (-11, 0, -6) um",
        fingerprint="Proportional to payload; the tool sags, toward the leg that carries most.",
        confused_with=(
            ("joint-clearance", "a step, not a slope: load and unload through several payloads"),
            ("column-bend", "the same everywhere in x and y: one payload at poses spread wide"),
            ("link-compliance", "like it times (L/w)^2: payloads at poses spread wide, a linear scale on the axis"),
        ),
        remedy="Preload the nut, stiffen bearing seats and screw; keep payloads alike and correct by payload.",
        needs="payload_kg (or measured loads tau1, tau2, ...) that varies",
        telling="load",
        shade="payload",
    ),
}
