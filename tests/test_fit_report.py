"""What a fit says in words and figures, and how it is written and read back; input that is refused."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from made_runs import KNOWN, empty_run, hidden_backlash, machine, term
from small_files import BARE
from test_fit import fitted

from ptt.errors import MachineError, ModelError, TableError
from ptt.fitting.observability import Combination
from ptt.fitting.report import Value, report_fit
from ptt.fitting.report_words import format_fit
from ptt.fitting.solve import fit
from ptt.machine import format_machine, parse_machine
from ptt.model.entries import read_model, write_model
from ptt.model.model import Model
from ptt.run.problem import build_problem

# --- report


def test_the_drawing_after_alignment_is_one_figure_whoever_prints_it() -> None:
    """Also with a frame of base reflectors, which a best motion of all readings would bend toward the errors."""
    from ptt.door.opened import open_run
    from ptt.door.options import ReadOptions
    from ptt.judge.compare.comparison import compare_run
    from ptt.judge.ladder.climb import climb

    data = Path(__file__).resolve().parents[1] / "data"
    for run, drawing in (("experiment1.csv", "machine.toml"), ("sealed_one/run.csv", "sealed_one/machine.toml")):
        opened = open_run(data / run, data / drawing, ReadOptions())
        ladder = climb(opened.model, opened.problem, [KNOWN["link-length"]()])
        compared = compare_run(opened.model, opened.problem).to_dict()["rms_um"]["total"]
        told = [ladder.report.rms_um[stage]["total"] for stage in ("aligned", "given")]
        assert [*told, ladder.steps[0].rms_um["total"]] == pytest.approx([compared] * 3, rel=1e-3)


def test_a_long_curve_is_one_line_of_a_report_and_a_short_list_is_none() -> None:
    problem, _ = hidden_backlash()
    report = report_fit(fitted(["backlash"], problem), problem)
    values = tuple(
        Value("screw-error-map", f"curve_mm {joint}.{n}", 0.01 * n, 0.002, kind)
        for joint, kind in ((1, "yes"), (2, "in part"))
        for n in range(1, 16)
    )
    few = tuple(Value("lead-scale", f"scale {joint}", 1e-4, 1e-5, "yes") for joint in (1, 2, 3))
    text = format_fit(replace(report, values=(*few, *values)))
    curves = [" ".join(line.split()).partition("; ")[0] for line in text.splitlines() if "curve_mm" in line]
    assert curves == [
        "curve_mm 1.1 to 15 0.01 to 0.15, 15 values of a curve: 15 measured",
        "curve_mm 2.1 to 15 0.01 to 0.15, 15 values of a curve: 15 measured in combinations",
    ]
    assert [line.split()[1] for line in text.splitlines() if line.startswith("    scale ")] == ["1", "2", "3"]


def test_a_share_beyond_a_thousand_percent_is_left_out() -> None:
    problem, _ = hidden_backlash()
    report = report_fit(fitted(["backlash"], problem), problem)
    values = tuple(
        Value("lead-scale", f"scale {n}", value, 2e-4, "yes") for n, value in ((1, 1e-4), (2, 2e-9), (3, 0.0))
    )
    lines = [line for line in format_fit(replace(report, values=values)).splitlines() if line.startswith("    scale ")]
    assert [line.endswith("%)") for line in lines] == [True, False, False] and "(200.0%)" in lines[0]


def test_many_combinations_without_a_trace_are_one_line() -> None:
    problem, _ = hidden_backlash()
    report = report_fit(fitted(["backlash"], problem), problem)
    blind = tuple(Combination("screw-error-map", f"waves_mm 1.{n}", (), {}) for n in range(1, 6))
    tied = Combination("screw-error-map", "straight_mm 1.1", ("lead-scale scale 1",), {})
    text = format_fit(replace(report, unobservable=(*blind, tied, Combination("link-length", "length_mm 1", (), {}))))
    lines = text.partition("[[what this run cannot tell]]\n")[2].splitlines()
    assert len(lines) == 3 and lines[0].strip().startswith("screw-error-map: 5 values and combinations leave no trace")
    assert "first waves_mm 1.1;" in lines[0] and "cannot be told from" in lines[1] and "length_mm 1 leaves" in lines[2]


def test_report_in_words_and_figures() -> None:
    problem, _ = hidden_backlash()
    result = fitted(["backlash", "homing-offset"], problem)
    report = report_fit(result, problem)
    text = format_fit(report)
    for words in ("converged", "drawing, frame as read", "drawing, frame aligned", "machine file", "gap_mm 1", "+-",
                  "against the mean of all joints", "cannot be told from tracker z"):  # fmt: skip
        assert words in text
    figures = report.to_dict()
    assert figures["reduced_chi2"] == pytest.approx(result.chi2 / result.freedom)
    assert figures["rms_um"]["as read"]["total"] > 1e6 > figures["rms_um"]["aligned"]["total"]
    assert [item["measured"] for item in figures["parameters"]] == ["yes"] * 3 + ["in part"] * 3


def test_a_fixed_parameter_stays_and_a_fit_is_written_and_read_back() -> None:
    problem, _ = hidden_backlash()
    start = replace(term("homing-offset", problem.view, [0.2, 0.0, 0.0]), fixed=frozenset({"offset"}))
    result = fit(Model(problem.file) + start + KNOWN["backlash"](), problem)
    torch.testing.assert_close(result.model.terms[1].theta, start.theta)
    again = read_model(parse_machine(format_machine(write_model(result.model))))
    for mine, theirs in zip(result.model.terms, again.terms, strict=True):
        torch.testing.assert_close(mine.theta, theirs.theta, rtol=0.0, atol=0.0)
    torch.testing.assert_close(again.terms[0].std, result.model.terms[0].std, equal_nan=True)
    assert again.terms[1].fixed == {"offset"}


# --- bad input: one clear line each


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (BARE + "screw_led_mm = 5\n", r"m\.toml: unknown key 'screw_led_mm'; did you mean 'screw_lead_mm'"),
        (BARE.replace("link_length_mm = 300", "link_length_mm = -300"), r"m\.toml key machine\.link_length_mm: .*-300"),
        (BARE + "sigma_mm = 0.004\n", r"m\.toml: unknown key 'sigma_mm'; it belongs in \[tracker\] or"),
        (BARE + "gravity = [0, 0, -1]\n", r"unknown key 'gravity'; it belongs in \[machine\] of kind = \"serial\""),
        (
            BARE + '[[effect]]\nname = "backlash"\ngap_mm = 0.04\n',
            r"'gap_mm'; values .* in \[effect\.parameters\]",
        ),
        (BARE + '[[effect]]\nname = "backlsh"\n', r"m\.toml.*effect 'backlsh' is not known; did you mean 'backlash'"),
        (BARE + '[[effect]]\nname = "backlash"\n' * 2, r"m\.toml.*effect 'backlash' is in the model already"),
    ],
)
def test_a_bad_machine_file_gives_one_clear_line(text: str, line: str) -> None:
    with pytest.raises((MachineError, ModelError), match=line) as caught:
        read_model(parse_machine(text, "m.toml"))
    assert "\n" not in str(caught.value)


def test_too_few_readings_are_refused() -> None:
    table = empty_run(20)
    with pytest.raises(TableError, match="only 0 readings"):
        build_problem(machine(), table)
