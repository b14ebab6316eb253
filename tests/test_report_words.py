"""Words and numbers of a report: digits, units, names, languages."""

import re
from pathlib import Path

import pytest

from ptt.dependence.said import MOVES
from ptt.effects.bench import sample_machine, sample_view
from ptt.effects.phrases import MOST_VALUES, ValuePhrase, compose
from ptt.judge.compare.rows import percent
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.show.plots.common import in_micro
from ptt.show.plots.depends import variable_label
from ptt.show.report.blocks import side_by_side
from ptt.show.report.card import TopCard
from ptt.show.report.numbers import chance, plus_minus
from ptt.show.report.source import short_names
from ptt.show.report.words import words_of


def test_names_are_the_shortest_that_differ() -> None:
    paths = [Path("/home/a/monday/run.csv"), Path("/home/a/friday/run.csv"), Path("../m.toml"), Path("../m.toml")]
    assert short_names(paths) == ["monday/run.csv", "friday/run.csv", "m.toml", "m.toml"]


def test_numbers_carry_the_digits_that_are_known() -> None:
    assert plus_minus(0.055166, 0.0013) == "0.0552 ± 0.0013"
    assert plus_minus(2.7253e-5, 5.1e-6) == "(2.73 ± 0.51) × 10⁻⁵"
    assert plus_minus(-1234.56, 12.0) == "−1235 ± 12"
    assert plus_minus(0.25, None) == "0.25"
    assert (chance(0.0), chance(0.04), chance(3e-7)) == ("< 10⁻¹²", "0.04", "3 × 10⁻⁷")


def test_nearly_all_is_not_all() -> None:
    assert [percent(share) for share in (0.5, 0.995, 0.99996, 1.0)] == [
        "50 %",
        "99.5 %",
        "> 99.9 %",
        "100 %",
    ]


def test_rows_stand_side_by_side() -> None:
    rows = [(str(number), "a", "b") for number in range(3)]
    assert side_by_side(rows) == [("0", "a", "b", "2", "a", "b"), ("1", "a", "b", "", "", "")]
    assert side_by_side([]) == [] and side_by_side(rows[:2]) == [("0", "a", "b", "1", "a", "b")]


def test_units_become_greek_and_names_do_not() -> None:
    assert in_micro("5 um, urad/N, rms_um, --chord-um, sum") == (
        "5 \N{MICRO SIGN}m, \N{MICRO SIGN}rad/N, rms_um, --chord-um, sum"
    )


def test_one_is_said_of_one_and_several_of_several() -> None:
    told = [TopCard({}, "", "", None, "", more).more_words for more in (1, 3)]
    assert told == ["1 smaller one is listed below", "3 smaller ones are listed below"]
    for more, words in ((1, "(and 1 smaller one)"), (2, "(and 2 smaller ones)")):
        sizes = range(MOST_VALUES + more, 0, -1)
        values = [ValuePhrase("", n, "{is_} {what} off", n, 0.01, "um", n) for n in sizes]
        assert compose(values, "link").endswith(words)


@pytest.mark.parametrize("kind", ["three-ptt", "serial"])
def test_every_variable_that_an_unknown_may_follow_has_a_label_with_its_unit_in_each_language(kind: str) -> None:
    """In a report 'gravity z' was called 'angle of joint ravity z', and the feed 'height of slider eed'."""
    view = sample_view(kind)
    table = make_table(view.p.numpy(), view.q.numpy(), measured=view.p.numpy(), time_s=view.time.numpy())
    problem = build_problem(sample_machine(kind), table)
    load = "torque2" if kind == "serial" else "force2"
    names = [
        *MOVES,
        "feed",
        f"{problem.file.machine.letter}2",
        "direction2",
        "speed2",
        load,
        "payload",
        "time",
        "run",
        "x",
    ]
    labels = {name: variable_label(name, problem) for name in names}
    for name, label in labels.items():
        assert ("joint" in label or "slider" in label) == name.endswith("2"), label
        assert MOVES.get(name, "") in label and re.search(r" \[\S.*\]$", label)
    unit = problem.file.machine.unit
    assert labels["feed"] == "feed [mm/s]" and labels["step"].endswith("[mm]") and labels["pause"].endswith("[s]")
    assert labels["reversal"].endswith(f"[{unit}]") and labels["way x"].endswith("[1]")
    say = words_of("zh")
    for text in (*labels.values(), ", ".join(labels.values()), f"varies with {labels['payload']}"):
        assert not re.findall(r"[a-z]{4,}", say(text)), say(text)
    for name, words in MOVES.items():
        for on in (words, f"{words} ({name})"):
            said = say(f"The remaining error in y depends on {on} (95 % of its variance).")
            assert not re.findall(r"[a-z]{4,}", said.replace(name, "")), said
