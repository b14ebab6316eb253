"""Words, units, marks and grids of the studio's pages."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from studio_sample import MACHINE, RUN, silent
from studio_sample import folder as folder
from studio_sample import here as here

from ptt.door.result import plain
from ptt.machine import parse_machine
from ptt.mechanisms.dexterity_report import describe_dexterity
from ptt.run.readers import load_mapping
from ptt.show.card.words import how_sure, in_prose, length, parameter_in_words, prefixed, pretty, spoken, value_in_words
from ptt.show.studio import jobs
from ptt.show.studio.card_figures import ruler_words, unknown_figure
from ptt.show.studio.column_rows import BETWEEN as DOT
from ptt.show.studio.page import doing
from ptt.show.studio.page_again import change
from ptt.show.studio.page_finish import trained_in_words
from ptt.show.studio.page_machine import PRESETS, arm_text, three_ptt_text
from ptt.show.studio.page_model import rows_in_words
from ptt.show.studio.page_unknown import how_it_follows
from ptt.show.studio.results import Source
from ptt.show.studio.seal_table import seal_html, truth_in_words
from ptt.show.studio.tool_tables import dexterity_html
from ptt.show.studio.units import unit_in_words

KEPT = "\N{NO-BREAK SPACE}"


def test_columns_are_said_in_a_grid_and_kept(here: Path):
    frame = pd.read_csv("run.csv", dtype=str)
    odd = {"x_meas": "A", "y_meas": "B", "z_meas": "C", "x_cmd": "goal 1", "y_cmd": "goal 2", "z_cmd": "goal 3"}
    metres = frame.rename(columns=odd)
    for title in ("A", "B", "C"):
        metres[title] = (metres[title].astype(float) / 1000.0).map("{:.9f}".format)
    metres.to_csv("odd.csv", index=False)
    seen = jobs.peek(Source("odd.csv"), silent)
    assert [c["quantity"] for c in seen["columns"] if c["title"] in "ABC"] == ["", "", ""]
    assert next(c for c in seen["columns"] if c["title"] == "A")["cells"][0] == metres["A"][0]
    said = {c["title"]: c["quantity"] or "ignore" for c in seen["columns"]}
    said |= {new: old for old, new in odd.items()}
    source = jobs.columns(Source("odd.csv"), said, dict.fromkeys("ABC", "m"), silent)
    assert load_mapping("columns.toml").units["A"] == "m" and source.options == ("--map", "columns.toml")
    np.testing.assert_allclose(
        jobs.look(source, MACHINE, silent).residual, jobs.look(RUN, MACHINE, silent).residual, atol=2e-6
    )


def test_a_column_is_shown_as_the_file_has_it_beside_what_it_was_read_as(here: Path):
    """Units are checked in this table: no value stands under a unit that it is not in."""
    frame = pd.read_csv("run.csv", dtype=str)
    frame["x_meas"] = (frame["x_meas"].astype(float) / 25.4).map("{:.5f}".format)
    frame["temp_c"] = "68.5"
    frame["timestamp"] = [f"13.02.2026 10:{row // 60:02d}:{row % 60:02d}" for row in range(len(frame))]
    frame = frame.drop(columns="time_s").rename(columns={"x_meas": "x_meas_in", "temp_c": "temp_f"})
    frame.to_csv("inch.csv", index=False)
    told = {row[0]: row[2:] for row in jobs.look(Source("inch.csv"), MACHINE, silent).column_rows}
    inches = frame["x_meas_in"][:3]
    unit, cells, read = told["x_meas_in"]
    assert (unit, cells) == ("in", DOT.join(inches)) and read.endswith(" mm")
    np.testing.assert_allclose([float(v) for v in read[:-3].split(DOT)], 25.4 * inches.astype(float), rtol=1e-5)
    assert told["temp_f"][::2] == ("\N{DEGREE SIGN}F", f"20.2778{DOT}20.2778{DOT}20.2778 \N{DEGREE SIGN}C")
    assert told["timestamp"] == ("date and time", DOT.join(frame["timestamp"][:3]), f"0{DOT}1{DOT}2 s")
    assert told["y_meas"] == ("mm", DOT.join(frame["y_meas"][:3]), "")
    sorted_ = Source("inch.csv", set_=("order=time",))
    frame[::-1].to_csv("inch.csv", index=False)
    first = {row[0]: row[2:] for row in jobs.look(sorted_, MACHINE, silent).column_rows}["timestamp"]
    assert first[1].startswith(frame["timestamp"].iloc[-1]) and first[2] == f"0{DOT}-1{DOT}-2 s"


@pytest.mark.parametrize("title", ["timestamp", "Datum"])
def test_the_grid_offers_date_and_time_for_a_column_of_stamps(here: Path, title: str):
    frame = pd.read_csv("run.csv", dtype=str).drop(columns="time_s")
    frame[title] = [f"13.02.2026 10:{row // 60:02d}:{row % 60:02d}" for row in range(len(frame))]
    frame.to_csv("stamps.csv", index=False)
    found = {column["title"]: column for column in jobs.peek(Source("stamps.csv"), silent)["columns"]}
    assert (found[title]["quantity"], found[title]["unit"]) == ("time", "stamp") and found["x_meas"]["unit"] == "mm"


def test_the_grid_has_motors_as_sliders_where_no_column_is_one(here: Path):
    frame = pd.read_csv("run.csv", dtype=str)
    sent = [f"b{number}_cmd" for number in (1, 2, 3)]
    motors = frame.assign(**{f"Motor {name[1]} [mm]": frame[name] for name in sent})
    for columns, quantity in ((motors, ""), (motors.drop(columns=sent), "b2_cmd")):
        columns.to_csv("motors.csv", index=False)
        found = {column["title"]: column["quantity"] for column in jobs.peek(Source("motors.csv"), silent)["columns"]}
        assert found["Motor 2 [mm]"] == quantity


def test_held_out_errors_of_a_network_are_those_of_the_physics_beside_it():
    """The model as given may have been fitted with the rows that are held out here: its error is no held-out one."""
    figures = {name: {"total": um} for name, um in (("given", 6.9), ("physics", 7.05), ("rbf", 7.02))}
    data = {"learned": {"x": True, "y": False, "z": True}, "centres": 8, "share": 0.01, "protocol": "blocks of poses"}
    said = trained_in_words(data | {"heldout_rms_um": figures}).replace(KEPT, " ")
    assert "8 nodes, for x, z" in said and "Held-out error 7.05 \N{MICRO SIGN}m \N{RIGHTWARDS ARROW} 7.02" in said
    assert "6.9" not in said


def test_a_unit_has_one_name_in_questions_and_chips():
    assert [unit_in_words(each) for each in ("mm_min", "um", "c", "row order")] == [
        "mm/min",
        "\N{MICRO SIGN}m",
        "\N{DEGREE SIGN}C",
        "row order",
    ]


def test_the_marks_of_a_ruler_are_sizes():
    micro = "\N{MICRO SIGN}m"
    value = {"size": 40.0, "worth": 0.8, "unit": micro}
    assert ruler_words(value) == (f"0.5 {micro}", f"5 {micro}", f"usual 50 {micro}", f"500 {micro}", "5 mm")
    assert ruler_words(value | {"worth": 0.0})[2] == "usual"


def test_an_opened_seal_is_said_in_units_with_prefixes():
    micro = "\N{MICRO SIGN}m"
    said = truth_in_words({"backlash_mm": [0.04028, 0.0179], "kind": "hose", "stiffness_n_per_mm": 0.5662})
    assert said == f"backlash 40, 18 {micro}; kind hose; stiffness 0.57 N/mm"
    assert truth_in_words({"frame_um_per_m_k": 12.84, "slip_time_s": 90.0}) == f"frame 13 {micro}/m/K; slip time 90 s"
    opened = {
        "right": False, "left_um": 0.2, "noise_um": {"total": 5.0},
        "hidden": [{"effect": "backlash", "is": "found", "instead": [], "size_um": 1234.0,
                    "truth": {"backlash_mm": [-0.04]}, "model": [{"name": "gap_mm 1", "value": -0.04, "std": 1e-4}]}],
        "named": [{"effect": "windup", "is": "wrong", "parameters": []}],
        "tool_error_um": {"before": {"x": 1.0, "y": 1.0, "z": 1.0, "total": 1.7}, "after": None},
    }  # fmt: skip
    page = seal_html(opened).replace(KEPT, " ")
    for words in ("1.23 mm", f"\N{MINUS SIGN}40 {micro}", "nothing of the kind", "cannot be followed", "Not right"):
        assert words in page


def test_dexterity_of_both_kinds_of_machine_is_a_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    home = {"q": [0.1], "condition": 21.5}
    space = {"poses": 9, "condition": {"least": 2.7, "median": 14.0, "largest": 868_894.3}}
    arm = space | {"most_isotropic_q": [-1.0, 0.5], "singular": [{"joints": [2, 3], "share": 0.22, "q": [0.0, 1.0]}]}
    page = dexterity_html({"home": home, "workspace": arm}).replace(KEPT, " ")
    assert "869,000" in page and "singular by joints 2 and 3: 22 % of walks" in page and "57 deg" in page
    page = dexterity_html({"home": home | {"edge_mm": 200.0}, "workspace": space | {"near_singular_share": 0.1}})
    page = page.replace(KEPT, " ")
    assert "200 mm" in page and "10.0 %" in page


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("platform_radius_mm = 200", "condition number at home</th><td>infinite (singular)"),
        ("slider_travel_mm = [9000, 9001]", "poses, least</th><td>4"),
        ("slider_travel_mm = [[150, 151], [260, 261], [370, 371]]", "no pose was found that the travel reaches"),
    ],
    ids=["equal radii", "far travel", "no common travel"],
)
def test_dexterity_of_an_odd_machine_is_a_table(change: str, words: str):
    own = {"base_radius_mm": 200, "platform_radius_mm": 100, "link_length_mm": 300, "slider_travel_mm": [150, 420]}
    own.pop(change.partition(" ")[0])
    lines = ["[machine]", 'kind = "three-ptt"', change, *(f"{key} = {value}" for key, value in own.items())]
    assert words in dexterity_html(plain(describe_dexterity(parse_machine("\n".join(lines))))).replace(KEPT, " ")


def test_a_run_that_got_worse_has_a_change_above_zero():
    assert (change(90.0), change(-60.2)) == (f"\N{MINUS SIGN}90.0{KEPT}%", f"+60.2{KEPT}%")


def test_words_have_prefixes_that_a_person_uses():
    assert [length(value) for value in (0.0, 5.6, 70.94, 1186.0, 2.5e6)] == [
        f"0{KEPT}\N{MICRO SIGN}m",
        f"5.60{KEPT}\N{MICRO SIGN}m",
        f"70.9{KEPT}\N{MICRO SIGN}m",
        f"1.19{KEPT}mm",
        f"2.5{KEPT}m",
    ]
    assert prefixed([12_000.0, -3.0], "urad") == (1e-3, "mrad") and prefixed([900.0], "um") == (1.0, "\N{MICRO SIGN}m")
    assert prefixed([5e-4], "um")[1] == "nm" and prefixed([0.0, 8e6], "s")[1] == "days"
    assert pretty("falls from 7 to 3 um, 2 urad/N m; a sum of um/m/K -> x") == (
        f"falls from 7 to 3{KEPT}\N{MICRO SIGN}m, 2{KEPT}\N{MICRO SIGN}rad/N{KEPT}m; a sum of \N{MICRO SIGN}m/m/K "
        "\N{RIGHTWARDS ARROW} x"
    )
    assert how_sure(0.9933) == "almost certain (> 99 %)" and how_sure(0.985) == "very likely (98 %)"
    assert how_sure(0.5) == "about even (50 %)"
    micro, off = "\N{MICRO SIGN}", "\N{PLUS-MINUS SIGN}"
    assert parameter_in_words("gap_mm 1", 0.040223, 8.1e-5) == ("gap 1", f"40.22{KEPT}{micro}m", f"{off}{KEPT}0.08")
    assert parameter_in_words("link_per_k", 1.1e-5, 2e-7) == ("link", f"11.00{KEPT}{micro}m/m/K", f"{off}{KEPT}0.20")
    assert parameter_in_words("period_mm", 5.02, None) == ("period", f"5.02{KEPT}mm", "")
    rows = rows_in_words(
        [("gap_mm 1", 3.9e-5, 7.1e-5, ""), ("gap_mm 2", 0.03965, 1.7e-4, ""), ("turn_rad", 2e-6, None, "held")]
    )
    assert [row[1] for row in rows] == [f"0.04{KEPT}{micro}m", f"39.65{KEPT}{micro}m", f"2{KEPT}{micro}rad"]
    assert parameter_in_words("scale 2", 6.2e-5, 1e-6)[1] == f"62.0{KEPT}{micro}m/m"
    assert doing("x", 3, 12, 6.0) == "x: 3 of 12, 2 s each, 18 s left" and doing("x", 0, 0, 0.5) == "x"


def test_a_figure_stays_on_one_line_with_its_unit():
    for text in ("5.26 um", "201 +- 4 um", "12 %", "1.6 um/m/K", "0.03 um/N", "21.4 \N{DEGREE SIGN}C", "90 s"):
        assert " " not in pretty(text)
    for text in ("3 causes found", "2 sliders", "5 more", "1 is", "read 300 rows and 4 months", "10 kinds"):
        assert pretty(text) == text
    assert spoken("b3", serial=False) == "height of slider 3" and spoken("q2", serial=True) == "angle of joint 2"
    assert spoken("direction1", serial=False) == "direction of slider 1" and spoken("time", serial=True) == "time"


def test_the_machine_form_writes_files_that_are_read(tmp_path: Path):
    values = {
        "base_radius_mm": 210.0,
        "platform_radius_mm": 95.0,
        "link_length_mm": 310.0,
        "least": 100.0,
        "most": 450.0,
    }
    values |= {"screw_lead_mm": None, "platform_mass_kg": 2.0}
    spec = parse_machine(three_ptt_text('say "hi"', False, values)).machine
    assert spec.kind == "three-ptt" and (spec.base_radius_mm, spec.sliders, spec.name) == (210.0, "below", "say hi")
    described = jobs.describe(three_ptt_text("m", True, values), silent)
    assert described["svg"].startswith("<svg") and "b1 =" in described["words"]
    for name, (convention, rows) in PRESETS.items():
        joints = [
            dict(zip(("a_mm", "alpha_deg", "d_mm", "theta_offset_deg"), map(float, row), strict=True)) for row in rows
        ]
        text = arm_text(name, convention, joints)
        assert len(parse_machine(text).machine.joint) == len(rows)
        assert len(jobs.describe(text, silent)["chain"]) == len(rows) + 2


def test_the_machine_form_keeps_every_digit():
    values = {"base_radius_mm": 1234.5678, "platform_radius_mm": 100.1234567, "link_length_mm": 1500.00041}
    values |= {"least": 1050.12345, "most": 2000.0, "screw_lead_mm": 25.4 / 7.0, "platform_mass_kg": 1e-7}
    spec = parse_machine(three_ptt_text("m", True, values)).machine
    assert spec.slider_travel_mm == (values.pop("least"), values.pop("most"))
    assert {key: getattr(spec, key) for key in values} == values
    joint = {"a_mm": -1612.34567, "alpha_deg": 89.9998765, "d_mm": 1e-5, "theta_offset_deg": 0.0}
    assert parse_machine(arm_text("arm", "standard", [joint])).machine.joint[0].model_dump(include=set(joint)) == joint


@pytest.mark.parametrize(
    ("on", "unit", "across"),
    [
        ("speed2", "mm/s", "speed of slider 2 [mm/s]"),
        ("temperature", "C", "temperature [\N{DEGREE SIGN}C]"),
        ("time", "s", "time [min]"),
        ("time", "", "reading number"),
        ("coolant", "", "coolant"),
    ],
)
def test_the_picture_of_an_unknown_has_the_unit_of_what_it_follows(on, unit, across):
    at = [0.0, 400.0, 800.0]
    unknown = {
        "residual": "slider 1", "on": on, "with": None, "period_mm": None,
        "curve": {"at": at, "mean_um": [1.0, 2.0, 3.0], "half_width_um": [0.1, 0.1, 0.1]},
        "points": {"at": at, "um": [1.0, 2.0, 3.0], "unit": unit},
    }  # fmt: skip
    assert unknown_figure(unknown, serial=False)["layout"]["xaxis"]["title"]["text"] == across


def test_what_takes_several_variables_is_not_said_of_the_curve_over_one():
    alone = {"residual": "slider 1", "on": "b1", "share": 0.7, "shape": "smooth", "together": []}
    said = "70\N{NO-BREAK SPACE}% of the variance of the remaining error of slider 1 depends on"
    assert how_it_follows(alone) == f"{said} it (smoothly)"
    field = alone | {"together": ["time", "b1"], "alone_share": 0.26}
    assert how_it_follows(field) == f"{said} time and b1 together; this curve over b1 alone shows 26\N{NO-BREAK SPACE}%"


def test_a_variable_of_a_joint_has_an_article_in_prose_and_a_column_of_ones_own_has_none():
    assert in_prose("b2", False) == "the height of slider 2" and in_prose("q3", True) == "the angle of joint 3"
    assert in_prose("payload", False) == "payload" and in_prose("flow2", False) == "flow2"


def test_an_error_that_says_nothing_of_a_value_is_no_figure_beside_it():
    assert value_in_words({"size": 0.229, "error": 905.7, "unit": "mm"}).endswith("mm, give or take many times that")
    assert "\N{PLUS-MINUS SIGN}" in value_in_words({"size": 0.229, "error": 0.002, "unit": "mm"})
