"""What a file leaves open is asked once: answers are saved, read again and refused where they say nothing."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from asking import FIXTURES, never, say
from numpy.testing import assert_allclose, assert_array_equal

from ptt.errors import TableError
from ptt.run.readers import Mapping, Request, load_mapping, read_any, save_mapping
from ptt.run.reading import read_table

AMBIGUOUS = {
    "thousands": (
        "x\ty\tz\n1,234\t2,345\t3,456\n1,235\t2,345\t3,456\n",
        "is the comma in 1,234 a decimal sign",
        "decimal",
    ),
    "two signs": ("x;y;z\n1,25;2.5;3\n1,5;2.5;3\n", "which is the decimal sign", "decimal"),
    "two columns": ("Measured X;实测X;y;z\n1;2;3;4\n2;3;4;5\n", "which column is x_meas", "[columns]"),
    "dates": ("x,y,z,time\n1,2,3,01/02/25 10:00\n1,2,4,02/02/25 10:00\n", "written day first or month first", "dates"),
    "payload in newtons": ("x,y,z,payload [N]\n1,2,3,4\n1,2,4,5\n", "which unit is it in", '[units] "payload [N]"'),
    "unknown unit": ("x [furlong],y,z\n1,2,3\n1,2,4\n", "unit 'furlong' does not fit x_meas", "[units]"),
    "payload in no known unit": (
        "x,y,z,payload_st\n1,2,3,4\n1,2,4,5\n",
        "'st' is not a known unit of payload",
        "[units]",
    ),
    "feed in feet": ("x,y,z,feed_ft_min\n1,2,3,4\n1,2,4,5\n", "'ft_min' is not a known unit of feed", "[units]"),
    "feed": ("x,y,z,feed\n1,2,3,4\n1,2,4,5\n", "which unit is feed in", "[units]"),
    "epoch": (
        "x,y,z,time\n1,2,3,1600000000000\n1,2,4,1600000000100\n",
        "column time: which unit is a time of 1600000000100",
        '[units] "time"',
    ),
}


@pytest.mark.parametrize("text, question, key", AMBIGUOUS.values(), ids=AMBIGUOUS.keys())
def test_ambiguity_is_asked(tmp_path: Path, text: str, question: str, key: str) -> None:
    path = tmp_path / "export.txt"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(TableError) as caught:
        read_any(path)
    assert question in str(caught.value)
    assert f"answer with --map FILE.toml, {key}" in str(caught.value)
    asked: list[str] = []

    def ask(what: str, choices: Sequence[str]) -> str:
        asked.append(what)
        return choices[0]

    first = read_any(path, Request(ask=ask))
    assert len(asked) == 1
    if "time" not in key:
        again = read_any(path, Request(mapping=first.understood.mapping, ask=never))
        for quantity, values in first.columns.items():
            assert_array_equal(again.columns[quantity], values)


@pytest.mark.parametrize("title", ["payload [N]", "payload_N", "Nutzlast (N)", "Gewicht [N]"])
def test_a_weight_in_newtons_is_told_how_to_become_a_mass(tmp_path: Path, title: str) -> None:
    path = tmp_path / "run.csv"
    path.write_text(f"x,y,z,{title}\n1,2,3,4\n1,2,4,5\n", encoding="utf-8")
    with pytest.raises(
        TableError, match="unit 'N' does not fit payload; a weight in newtons is not a mass: divide it by"
    ):
        read_any(path)


@pytest.mark.parametrize("title", ["Load [N]", "Belastung (N)", "Masse_N"])
def test_a_load_in_newtons_is_asked_about_for_it_may_be_a_motors(tmp_path: Path, title: str) -> None:
    path = tmp_path / "run.csv"
    path.write_text(f"x,y,z,{title}\n1,2,3,4\n1,2,4,5\n", encoding="utf-8")
    with pytest.raises(TableError, match=r"a weight in newtons is not a mass.*or is it something else.*'ignore'"):
        read_any(path)
    assert read_any(path, Request(ask=say("ignore"))).understood.ignored == (title,)
    assert read_any(path, Request(mapping=Mapping(units={title: "ignore"}))).understood.ignored == (title,)
    assert read_any(path, Request(mapping=Mapping(columns={title: "ignore"}))).understood.ignored == (title,)
    path.write_text(f"x,y,z,payload_kg,{title}\n1,2,3,4,5\n1,2,4,5,6\n", encoding="utf-8")
    assert read_any(path).understood.ignored == (title,)


@pytest.mark.parametrize(
    ("title", "said", "units", "factor"),
    [
        ("Tool weight [lb]", "payload", {}, 0.45359237),
        ("Tool weight [lb]", "payload_lb", {}, 0.45359237),
        ("Tool weight, lb", "payload", {}, 0.45359237),
        ("Tool weight [lb]", "payload_kg", {"Tool weight [lb]": "g"}, 1e-3),
        ("Tool weight [lb]", "payload", {"Tool weight [lb]": "kg"}, 1.0),
        ("Tool (left)", "payload_g", {}, 1e-3),
        ("Scale (2)", "payload", {}, 1.0),
        ("Scale G", "payload", {}, 1.0),
        ("Foo A [in]", "payload", {"Foo A [in]": "kg"}, 1.0),
        ("Foo A [in]", "b1_cmd", {}, 25.4),
        ("Foo A [in]", "q1_cmd", {}, 25.4),
    ],
)
def test_the_unit_in_a_title_counts_where_the_mapping_says_what_it_holds(
    tmp_path: Path, title: str, said: str, units: dict[str, str], factor: float
) -> None:
    path = tmp_path / "run.csv"
    path.write_text(f'x,y,z,"{title}"\n1,2,3,4\n1,2,4,5\n', encoding="utf-8")
    read = read_any(path, Request(mapping=Mapping(columns={title: said}, units=units)))
    (quantity,) = read.columns.keys() - {"x_meas", "y_meas", "z_meas"}
    assert quantity in ("payload", "b1_cmd")
    assert_allclose(read.columns[quantity], [4 * factor, 5 * factor], rtol=1e-15)


def test_a_mapping_that_contradicts_the_title_is_asked_about(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("x,y,z,Tool weight [lb]\n1,2,3,4\n1,2,4,5\n", encoding="utf-8")
    mapping = Mapping(columns={"Tool weight [lb]": "payload_kg"})
    with pytest.raises(TableError, match="the title says 'lb' and the mapping 'payload_kg'; which unit is it in"):
        read_any(path, Request(mapping=mapping))
    assert read_any(path, Request(mapping=mapping, ask=say("kg"))).columns["payload"][0] == 4.0
    with pytest.raises(TableError, match="unit 'st' does not fit payload"):
        path.write_text("x,y,z,Tool [st]\n1,2,3,4\n1,2,4,5\n", encoding="utf-8")
        read_any(path, Request(mapping=Mapping(columns={"Tool [st]": "payload"})))


def test_an_axis_slides_or_turns_as_its_unit_says(tmp_path: Path) -> None:
    path, axes = tmp_path / "run.csv", ("Achse 1 Soll", "Achse 2 Soll", "Achse 3 Soll")
    rows = "314,315,316,1,2,3\n317,318,319,1,2,4\n"
    path.write_text(f"{','.join(f'{axis} [mm]' for axis in axes)},x,y,z\n{rows}", encoding="utf-8")
    table = read_table(path)
    assert table.command is not None
    assert_array_equal(table.command[0], [314, 315, 316])
    path.write_text(f"{','.join(axes)},x,y,z\n{rows}", encoding="utf-8")
    question = (
        r"which unit is q1_cmd in \('mm': it is the slider b1_cmd\)\?; .* \[units\] \"Achse 1 Soll\" = one of 'rad'"
    )
    with pytest.raises(TableError, match=question):
        read_table(path)
    for found in (
        read_table(path, ask=say("mm")),
        read_table(path, mapping=Mapping(units=dict.fromkeys(axes, "mm")), ask=never),
        read_table(path, mapping=Mapping(units=dict.fromkeys(axes, "mm"), columns={axes[0]: "q1_cmd"}), ask=never),
    ):
        assert_array_equal(found.command, table.command)
        assert read_table(path, mapping=found.understood.mapping, ask=never).understood.lines[1:4] == tuple(
            f"'{axis}' is b{number}_cmd [mm]" for number, axis in enumerate(axes, 1)
        )
    path.write_text("b1_cmd,Achse 1,x,y,z\n1,90,1,2,3\n2,90,1,2,4\n", encoding="utf-8")
    with pytest.raises(TableError, match=r"which unit is q1_cmd in\?"):  # the slider has its column
        read_any(path)


def test_pounds_and_inches_a_minute_are_read(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("x,y,z,payload_lb,feed_in_min\n1,2,3,4,60\n1,2,4,5,60\n", encoding="utf-8")
    read = read_any(path)
    assert_allclose(read.columns["payload"], [4 * 0.45359237, 5 * 0.45359237], rtol=1e-15)
    assert_allclose(read.columns["feed"], [25.4, 25.4], rtol=1e-15)


def test_a_column_that_only_begins_as_a_known_one(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"

    def ignored(titles: str, mapping: Mapping | None = None) -> tuple[str, ...]:
        path.write_text(f"x,y,z,{titles}\n1,2,3,4,5\n1,2,4,5,6\n", encoding="utf-8")
        return read_any(path, Request(mapping=mapping or Mapping())).understood.ignored

    assert ignored("temp_c,temp_spindle") == ("temp_spindle",)  # another column holds the quantity
    assert ignored("temp_air,temp_oil") == ("temp_air", "temp_oil")  # names of two, no unit of one
    assert ignored("temp_2,note") == ("temp_2", "note")
    assert ignored("payload_st,note", Mapping(units={"payload_st": "ignore"})) == ("payload_st", "note")
    assert ignored("payload_st,note", Mapping(columns={"payload_st": "ignore"})) == ("payload_st", "note")
    assert ignored("payload_st,note", Mapping(units={"payload_st": "kg"})) == ("note",)


def test_an_answer_that_is_no_choice_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "export.txt"
    path.write_text(AMBIGUOUS["feed"][0], encoding="utf-8")
    with pytest.raises(TableError, match="'knots' does not answer"):
        read_any(path, Request(ask=say("knots")))


def test_mapping_is_saved_and_reused(tmp_path: Path) -> None:
    path, saved = tmp_path / "run.csv", tmp_path / "answers.toml"
    path.write_text("Ort A;Ort B;Ort C;joint1;joint2\n0,1;0,2;0,3;90;45\n0,2;0,2;0,3;80;40\n", encoding="utf-8")
    with pytest.raises(TableError, match="which unit is q1_cmd in"):
        read_table(path, joints=2, joint_prefix="q")
    columns = {"Ort A": "x_meas", "Ort B": "y_meas", "Ort C": "z_meas"}
    units = {"Ort A": "m", "Ort B": "m", "Ort C": "m", "joint1": "deg", "joint2": "deg"}
    first = read_table(path, joints=2, joint_prefix="q", mapping=Mapping(columns=columns, units=units))
    assert_allclose(first.measured[0], [100, 200, 300], rtol=1e-15)
    assert_allclose(first.command[0], np.radians([90, 45]), rtol=1e-15)
    save_mapping(first.understood.mapping, saved)
    assert load_mapping(saved) == first.understood.mapping
    again = read_table(path, joints=2, joint_prefix="q", mapping=saved, ask=never)
    assert_array_equal(again.measured, first.measured)


def test_a_mapping_path_that_does_not_exist_is_written(tmp_path: Path) -> None:
    saved = tmp_path / "answers.toml"
    first = read_table(FIXTURES / "spatial_analyzer.txt", targets=FIXTURES / "targets.csv", mapping=saved)
    answers = load_mapping(saved)
    assert answers.pairing == "name"
    assert answers.targets is not None
    assert answers.targets.columns["payload_kg"] == "payload"
    again = read_table(FIXTURES / "spatial_analyzer.txt", targets=FIXTURES / "targets.csv", mapping=saved, ask=never)
    assert_array_equal(again.measured, first.measured)
    assert_array_equal(again.time_s, first.time_s)
    said = f"{saved}: did not exist; written with the columns and units as understood"
    assert said in first.understood.lines and said not in again.understood.lines


def test_mapping_can_ignore_and_names_what_is_absent(tmp_path: Path) -> None:
    columns = {"温度（℃）": "ignore", "nowhere": "x_meas"}
    table = read_table(FIXTURES / "chinese.csv", mapping=Mapping(columns=columns))
    assert table.temp_c is None
    assert "in the mapping but not in the file: nowhere" in str(table.understood)


@pytest.mark.parametrize(
    "text, message",
    [
        ("colour = 'red'", "unknown key 'colour'"),
        ("decimal = ':'", "decimal = ':' is not known"),
        ("columns = 'x'", "key 'columns' is not a table of texts"),
        ("[units]\nx = 3", "key 'units' is not a table of texts"),
        ("encoding = 8", "key 'encoding' is not a text"),
        ("= =", "not valid TOML"),
        ("[targets]\ncolour = 'red'", "unknown key 'colour'"),
    ],
)
def test_bad_mapping_files(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "map.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(TableError) as caught:
        read_table(FIXTURES / "chinese.csv", mapping=path)
    assert message in str(caught.value)


def test_bad_meaning_in_a_mapping() -> None:
    with pytest.raises(TableError, match="unknown meaning 'colour'"):
        read_any(FIXTURES / "chinese.csv", Request(mapping=Mapping(columns={"备注": "colour"})))


def test_a_column_that_is_set_aside_may_have_the_title_that_another_one_has_the_values_of(tmp_path: Path) -> None:
    """What is ignored stays as it is written, and what is read in its place is not confused with it."""
    path = tmp_path / "export.csv"
    path.write_text("X2,x_meas,y_meas,z_meas\n1.5,-,2,3\n1.6,-,2,4\n")
    found = read_any(path, Request(mapping=Mapping(columns={"x_meas": "ignore", "X2": "x_meas"}, units={"X2": "mm"})))
    assert_allclose(found.columns["x_meas"], [1.5, 1.6])
    assert_array_equal(found.extra["x_meas"], ["-", "-"])


@pytest.mark.parametrize(
    ("title", "below", "factor"),
    [
        ("tau1", "", 1.0),
        ("Torque 1 [N]", "", 1.0),
        ("Torque 1 [N mm]", "", 1e-3),
        ("Drehmoment 1 (Ncm)", "", 1e-2),
        ("tau1_kn", "", 1e3),
        ("tau1", "mm;mm;mm;mm;mm;mm;kN m\n", 1e3),
    ],
)
def test_a_load_of_a_joint_is_read_in_its_unit(tmp_path: Path, title: str, below: str, factor: float) -> None:
    """The unit was dropped: a thousand N mm were a thousand N m, and so was a thousand percent."""
    path = tmp_path / "run.csv"
    path.write_text(f"x_cmd;y_cmd;z_cmd;x_meas;y_meas;z_meas;{title}\n{below}1;2;3;1;2;3;50\n4;5;6;4;5;6;60\n")
    table = read_table(path)
    assert table.torque is not None
    np.testing.assert_allclose(table.torque[:, 0], factor * np.array([50.0, 60.0]))


def test_the_answer_on_an_epoch_is_taken_as_the_question_says(tmp_path: Path) -> None:
    """The key that it named lacked the title of the column."""
    path = tmp_path / "run.csv"
    path.write_text(AMBIGUOUS["epoch"][0])
    for unit, step in (("ms", 0.1), ("s", 100.0)):
        time = read_any(path, Request(mapping=Mapping(units={"time": unit}), ask=never)).columns["time"]
        assert_allclose(np.diff(time), step, rtol=1e-5)


def test_a_load_in_no_unit_of_force_is_asked_about(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("x_cmd;y_cmd;z_cmd;x_meas;y_meas;z_meas;Torque 1 [%]\n1;2;3;1;2;3;50\n4;5;6;4;5;6;60\n")
    with pytest.raises(
        TableError, match=r"column Torque 1 \[%\]: unit '%' does not fit tau1; .* or is it something else"
    ):
        read_table(path)
    for said in (Mapping(units={"Torque 1 [%]": "ignore"}), Mapping(columns={"Torque 1 [%]": "ignore"})):
        table = read_table(path, mapping=said)
        assert table.torque is None and table.understood.mapping.columns["Torque 1 [%]"] == "ignore"
    known = read_table(path, mapping=Mapping(units={"Torque 1 [%]": "ncm"})).torque
    assert known is not None and known[0, 0] == 0.5
