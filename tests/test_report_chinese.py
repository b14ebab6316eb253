"""What a report says of every effect in Chinese: nothing half said, each part by itself, each side that of its sign."""

import re
from itertools import groupby

import numpy as np
import pytest
import torch

from ptt.dependence.dependence import Dependence
from ptt.dependence.said import say_size
from ptt.dependence.size import Size
from ptt.diagnosis.search.excess import Objections, beyond_noise
from ptt.diagnosis.telling.diagnosis import SCALE_BAR
from ptt.diagnosis.telling.verdict_words import MISSING, MOSTLY_UNTOLD, depends, held_to_base
from ptt.diagnosis.telling.words import headline
from ptt.effects import library
from ptt.effects.cards import card_of
from ptt.effects.case import make_case
from ptt.effects.layout import linear_size
from ptt.effects.phrases import MANY, MOST_VALUES, ONE, capital, compose, doubt, remedies, worth_saying
from ptt.judge.run_errors import frame_words
from ptt.model.chain import differentiate
from ptt.plan.separation import BASE
from ptt.plan.words import say_ambiguity
from ptt.show.card.words import pretty
from ptt.show.report.words import inflected, phrases_of, words_of

pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")

SAY, TABLES = words_of("zh"), phrases_of("zh")
TOLD = {  # every side and every cure of the file, as said of one and of several
    inflected(key, form): value
    for table in ("side", "cure")
    for key, value in TABLES[table].items()
    for form in (ONE, MANY)
    if not key.startswith(("{side}", "{cure}", "repeat"))
}
CASES = [(name, kind) for name, make in library().items() for kind in make().mechanisms]
# Units, signs of quantities, names of columns and of keys of a machine file, words of figures.
PLAIN = re.compile(r"[A-Za-z]\d?|[numkµ]?(m|rad|g|s|N)|deg|DH|[a-z]+\d?(_\w+)+|tau\d|frame|measured")
OBJECTIONS = ("unproven", "impossible", "idle", "backward")
CURVES = (  # what is said of curves, beside the phrases of the effects
    ("run{s} up to {what} high", "run{s} up to {what} low"),
    ("run{s} up to {what} ahead", "run{s} up to {what} behind"),
    ("sag{s} up to {what} toward +q", "sag{s} up to {what} toward -q"),
    ("wander{s} up to {what} outward", "wander{s} up to {what} inward"),
    (
        "wander{s} up to {what} counter-clockwise (seen from above)",
        "wander{s} up to {what} clockwise (seen from above)",
    ),
)
SIDES = (  # two sides in English, and the same in Chinese
    (("warmer", "cooler"), ("高", "低")),
    (("higher", "lower"), ("高", "低")),
    (("high", "low"), ("高", "低")),
    (("up", "down"), ("上", "下")),
    (("upward", "downward"), ("上", "下")),
    (("rise", "sink"), ("升高", "降低")),
    (("raise", "lower"), ("调高", "调低")),
    (("raise", "lower"), ("增加", "减少")),
    (("add", "take"), ("增加", "减少")),
    (("+", "-"), ("+", "-")),
    (("+q", "-q"), ("+q", "-q")),
    (("late", "early"), ("滞后", "超前")),
    (("ahead", "behind"), ("超前", "落后")),
    (("give", "against"), ("退让", "逆着")),
    (("grow", "shrink"), ("变长", "变短")),
    (("outward", "inward"), ("外", "内")),
    (("counter-clockwise", "clockwise"), ("逆时针", "顺时针")),
    (("too long", "too short"), ("长", "短")),
    (("reads lengths {what} too long", "too short"), ("偏长", "偏短")),
    (("longer", "shorter"), ("变长", "变短")),
    (("lengthen", "shorten"), ("加长", "缩短")),
    (("stretch", "shorten"), ("伸长", "缩短")),
    (("travel", "not far enough"), ("长", "短")),
    (("turn", "not far enough"), ("多", "少")),
    (("too far", "too little"), ("大", "小")),
    (("too much", "too little"), ("大", "小")),
    (("lose", "compensate"), ("丢失", "补偿过多")),
    (("of play", "less than no play"), ("有", "比零还小")),
    (("change", "run ahead"), ("落后", "超前")),
)


def latin(text):
    """Words of a sentence that are no more than units, columns or names of effects."""
    for name in library():
        text = text.replace(name, "")
    return [word for word in re.findall(r"[A-Za-zµ]\w*", text) if not PLAIN.fullmatch(word)]


def values(case):
    """All values above zero, all below, and of either sign in turn, three sizes in each."""
    size = torch.ones_like(case.theta)
    linear = linear_size(case.effect, case.view.joints)
    turns = torch.where(torch.arange(linear) % 2 == 0, 1.0, -1.0).double()
    sizes = torch.tensor([1.0, 0.6, 0.8], dtype=torch.float64).repeat(linear)[:linear]
    for signs in (torch.ones_like(turns), -torch.ones_like(turns), turns, -turns):
        size[:linear] = signs * sizes
        yield (
            case.theta.abs() * size
            if case.effect.name == "backlash"
            else torch.cat([case.theta[:linear].abs() * size[:linear], case.theta[linear:]])
        )


def groups_of(parts):
    """The values that one clause tells: of one subject, with one thing to say."""
    ordered = sorted(worth_saying(parts)[:MOST_VALUES], key=lambda part: (part.who, part.text, part.joint))
    return [list(group) for _, group in groupby(ordered, key=lambda part: (part.who, part.text))]


def nouns_of(effect, kind):
    return effect.arm_noun if kind == "serial" else effect.noun


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_an_effect_is_said_whole_and_part_by_part(name, kind):
    effect = library()[name]()
    case, noun = make_case(effect, kind, differentiate), nouns_of(effect, kind)
    for theta in values(case):
        parts = effect.say(theta, torch.full_like(theta, torch.nan), case.view)
        for some in (parts, parts[:1], parts[:2]):
            english, cause = compose(some, noun), effect.cause(theta, case.view)
            text = SAY(pretty(f"{capital(english)}: {cause}{doubt(some)}."))
            assert latin(text) == [] and text.endswith("。"), text
            each = [(compose(group, noun), group[0].who) for group in groups_of(some)]
            told = [(one, SAY(pretty(f"{one}: {cause}")).split("：")[0]) for one, _ in each if one in english]
            # What is said by itself is said the same among others: no part loses its side to another one.
            assert (told or not each) and [own for _, own in told if own not in text] == []
            cure = remedies(some, noun)
            assert latin(SAY(f"{cure}.")) == []
            mends = [part for part in worth_saying(some) if part.mend][:MOST_VALUES]
            assert [one for part in mends if (one := SAY(remedies([part], noun))) not in SAY(cure)] == []


def has(word, text):
    """Whether a text has a word by itself: 'clockwise', but not in 'counter-clockwise'."""
    return re.search(rf"(?<![\w-]){re.escape(word)}s?(?![a-z])", re.sub("{(s|es|is_|has)}", "", text)) is not None


def pairs():
    """Every two sides of a value that the library can say, and every two ways to set them right."""
    found = dict.fromkeys(CURVES)
    for name, kind in CASES:
        for phrase in library()[name]().phrases:
            mend = phrase.arm_mend if kind == "serial" else phrase.mend
            found |= dict.fromkeys([phrase.on(kind), tuple(text.replace("{turn}", "") for text in mend)])
    return [pair for pair in found if any(pair)]


@pytest.mark.parametrize("pair", pairs())
def test_the_side_that_is_said_is_the_one_of_the_sign(pair):
    above, below = (TOLD[inflected(text, ONE)] for text in pair)
    meant = [
        (one, other)
        for words, signs in SIDES
        for more, less, one, other in ((*words, *signs), (*words[::-1], *signs[::-1]))
        if has(more, pair[0]) and has(less, pair[1])
    ]
    assert any(one in above and other in below and one not in below and other not in above for one, other in meant)


def test_no_side_is_without_its_opposite():
    assert set(TOLD) == {inflected(text, form) for pair in pairs() for text in pair for form in (ONE, MANY)}


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_what_a_card_tells_is_said_whole(name, kind):
    card = card_of(library()[name]()).on(kind)
    told = [f"Its signature: {card.fingerprint.rstrip('.')}.", card.cause, f"{pretty(card.remedy.rstrip('.'))}."]
    assert [words for words in told if latin(SAY(words))] == []


def test_what_is_said_beside_a_finding():
    keys = ["homing-offset", "tower-tilt", "link-length"]
    ties = [headline("backlash", keys[:2], keys), headline("backlash", keys[:1], ()), headline("backlash", (), keys)]
    assert [latin(SAY(tie)) for tie in ties] == [[], [], []]
    assert SAY(ties[1]) == "反向间隙 或 回零偏差：这些数据无法区分。"
    fall = "the held-out error after backlash and link-length falls from 45.1 to 6.8 um (noise 6.9 um)"
    size = "the effect amounts to 44 um rms at the tool, mostly cancelled by the other effects"
    moved = "base reflectors were not read before and after it, so a base, a platform or a reflector that moved"
    open_yet = "the readings leave the tool position uncertain by up to 8.4 um"
    assert latin(SAY(f"Nothing else explains it as well; {fall}; {size}; {open_yet}.")) == []
    assert latin(SAY(f"{capital(moved)} would look the same.")) == []


@pytest.mark.parametrize("words", ["1 smaller one is listed below.", "3 smaller ones are listed below."])
def test_what_is_not_shown_on_the_card_is_said(words):
    assert latin(SAY(words)) == []


def test_what_to_measure_next_is_said():
    lines = (
        "Measure 80 rows further out in x and y (to 181 mm, where the run went to 107), and over 200 mm of height, "
        "where the run had 90, each pose from both sides of every joint, with the payloads of the column payload_kg "
        "(0, 5 kg).",
        "Measure 8 rows over the same volume, each pose from both sides of every joint.",
        "The separation of lead-scale from screw-error-map rises from 5.7 to 6.7 sigma; 8 sigma would need more rows.",
        say_ambiguity("homing-offset", "tower-tilt", BASE),
        SCALE_BAR,
    )
    assert [latin(SAY(line)) for line in lines] == [[]] * len(lines)


def test_what_speaks_against_an_explanation_is_said():
    two = ("backlash", "windup")
    against = [Objections(**{kind: names}) for kind in OBJECTIONS for names in (two, two[:1])]
    against += [Objections(faithful=False), Objections(set_aside="change sign with the direction of arrival")]
    reasons = [*(reason for each in against for reason in each.reasons), beyond_noise("this", 3.0, "machine file")]
    assert len(reasons) == 2 * len(OBJECTIONS) + 3
    assert [latin(SAY(f"{MISSING}: {reason}.")) for reason in reasons] == [[]] * len(reasons)


@pytest.mark.parametrize("rms", [None, 0.2])
@pytest.mark.parametrize("value", [0.06, -0.001])
@pytest.mark.parametrize("kind", ["side", "varying", "step", "bump", "period", "law", "turn"])
def test_how_large_an_unknown_is_is_said(kind, value, rms):
    ends = {"low": 20.4, "high": 26.7, "unit": "C", "along": "temperature", "rms": rms}
    for of, on in (("slider 1", "direction1"), ("rail 1 outward", "direction1"), ("x", "direction2")):
        size = Size(of, kind, value, 0.001, other=0.0, other_std=1e-6, on=on, **ends)
        more = Size(of, kind, value, 0.001, other=0.004, other_std=0.001, on=on, **ends)
        bound = Size(of, kind, value, 0.001, other=0.001, other_std=0.001, on=on, **ends)
        told = [SAY(say_size(one)) for one in (size, more, bound)]
        assert [re.findall(r"[a-z]{4,}", re.sub(r"direction\d", "", text)) for text in told] == [[]] * 3


@pytest.mark.parametrize("rivals", [(), ("x on time",), ("x on time", "x on z"), ("x on time", "x on y", "x on z")])
def test_what_an_unknown_follows_is_said_with_what_went_along(rivals):
    told = Dependence("x", "temperature", 0.5, 0.0, None, "smooth", np.zeros((0, 3)), rivals=rivals)
    slider = Dependence("slider 2", "direction2", 0.5, 0.0, None, "gradual", np.zeros((0, 3)), with_="b2")
    assert re.findall(r"[a-z]{4,}", SAY(f"{MOSTLY_UNTOLD}.")) == []
    for each in (told, slider):
        assert re.findall(r"[a-z]{4,}", re.sub(r"direction\d", "", SAY(depends(each)))) == []


def test_what_is_not_known_whole_stays_whole():
    for text in (
        "Link 1 is 120 um too long, link 2 is 48 um too plump: link length.",
        "raise slider 2 by 199 um and paint slider 1 by 147 um",
        "Slider 1 loses 5 um on reversal: a cause that nobody translated.",
        "a phrase that nobody translated",
    ):
        assert SAY(text) == text
    two = SAY("Link 1 is 120 um too long: link length. Nobody knows. Link 2 is 48 um too short: link length.")
    assert two == "连杆 1 长出 120 um：连杆长度。Nobody knows. 连杆 2 短了 48 um：连杆长度。"


def test_a_sentence_of_several_parts_keeps_each_side():
    assert SAY("Link 1 is 120 um too long, link 2 is 48 um too short: link length.") == (
        "连杆 1 长出 120 um，连杆 2 短了 48 um：连杆长度。"
    )
    assert SAY("raise slider 2 by 199 um (9.0 deg of its screw) and lower slider 1 by 147 um") == (
        "将滑块 2 调高 199 um（丝杠转 9.0°）；将滑块 1 调低 147 um"
    )


@pytest.mark.parametrize("policy", ["fitted", "fitted-per-run", "measured", "trusted"])
@pytest.mark.parametrize("seated", [False, True])
def test_what_is_taken_off_before_readings_are_compared_is_said_in_a_title(policy, seated):
    said = SAY(f"Tool against its targets, RMS in um ({frame_words(policy, seated=seated)})")
    assert said.startswith("工具相对于目标") and ("反射靶在工具上" in said) == seated
    assert not re.search(r"[A-Za-z]{3}", said)


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_what_tells_effects_apart_is_said_in_chinese(name, kind):
    for _, how in card_of(library()[name]()).on(kind).confused_with:
        said = SAY(f"What may tell them apart: {how}.")
        assert not re.findall(r"[a-z]{4,}", said.replace("dtheta", "").replace("temp_c", "")), how


def test_what_a_run_lacks_to_test_an_effect_is_said_in_chinese():
    lacks = (
        "joint values spread over more phases of gear_period_rad, a whole turn where the file has none",
        "poses that turn the arm against gravity",
        "poses whose heights are not commensurate with the lead",
        "readings at different travel since reversal (some within a few mm of it)",
        "screw_lead_mm (gear_period_rad for an arm) in the machine file",
    )
    for lack in lacks:
        assert latin(SAY(lack)) == [], lack
    either = "It may be once-per-rev or joint-error-map"
    several = f"{either}; to test that, `ptt diagnose` needs {lacks[0]} and {lacks[1]}."
    assert latin(SAY(several).replace("ptt diagnose", "")) == []


def test_the_error_in_the_frame_of_base_reflectors_and_two_runs_are_said_in_chinese():
    said = SAY(f"The error is 30.6 um; the noise is 4.1 um (from the std columns).{held_to_base(44.2)}")
    assert latin(said.replace("compare", "").replace("add", "")) == [], said
    assert "rows" not in SAY("run 1 (80 rows), run 2 (90 rows)")
    for text in ("scatter of x, as the tracker says", "Columns of the first file, as understood"):
        assert latin(SAY(text)) == []
