"""The tracker CSV: what is read, what is refused and with which words, and that writing loses nothing."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from ptt.errors import TableError
from ptt.run.given_noise import noise_from_std
from ptt.run.reading import read_table
from ptt.run.written import table_to_frame

HEADER = "x_cmd,y_cmd,z_cmd,x_meas,y_meas,z_meas"
TURN = "qx_meas,qy_meas,qz_meas,qw_meas"
ROWS = ["0,0,300,0.1,0.2,300.3", "10,0,300,10.1,0.2,300.3", "10,20,310,10.1,20.2,310.3"]


def write(folder: Path, text: str, name: str = "run.csv") -> Path:
    path = folder / name
    path.write_bytes(text.encode())
    return path


def csv(*rows: str, header: str = HEADER) -> str:
    return "\n".join([header, *rows]) + "\n"


def test_plain_run(tmp_path: Path) -> None:
    table = read_table(write(tmp_path, csv(*ROWS)))
    assert_array_equal(table.target, [[0, 0, 300], [10, 0, 300], [10, 20, 310]])
    assert_array_equal(table.measured[2], [10.1, 20.2, 310.3])
    assert table.rows == 3
    assert table.joints == 0
    assert table.command is None
    assert table.observed.all()
    assert_array_equal(table.line, [2, 3, 4])
    assert table.run_label == ("",)
    assert np.isnan(table.repeat).all()
    assert table.target.dtype == table.measured.dtype == np.float64
    assert "columns as named" in str(table.understood)


def test_every_column(tmp_path: Path) -> None:
    header = (
        "name,role,run,repeat,time_s,payload_kg,temp_c,feed_mm_s,dir1,dir2,dir3,tau1,tau2,tau3,x_std,y_std,z_std,"
        "qx_meas,qy_meas,qz_meas,qw_meas,qx_cmd,qy_cmd,qz_cmd,qw_cmd,b1_cmd,b2_cmd,b3_cmd," + HEADER
    )
    rows = [
        f"P1,pose,late,1,0.5,2,20.5,50,1,-1,,3,4,5,.001,.002,.003,0,0,0,1,0,0,1,0,500,501,502,{ROWS[0]}",
        f"007,DATUM,early,2,1.5,2,20.6,50,-1,-1,0,3,4,5,.001,.002,.003,0,0,0,1,0,0,1,0,500,501,503,{ROWS[1]}",
        "NA,base,late,,2.5,2,20.7,50,1,1,1,3,4,5,,,,0,0,0,1,0,0,1,0,,,,,,,1,2,3",
    ]
    table = read_table(write(tmp_path, csv(*rows, header=header)))
    assert table.name.tolist() == ["P1", "007", "NA"]
    assert table.role.tolist() == ["pose", "datum", "base"]
    assert table.run.tolist() == [0, 1, 0]
    assert table.run_label == ("late", "early")
    assert_array_equal(table.repeat, [1, 2, np.nan])
    assert_array_equal(table.direction, [[1, -1, np.nan], [-1, -1, np.nan], [1, 1, 1]])
    assert_array_equal(table.torque[0], [3, 4, 5])
    assert_array_equal(table.std[:, 0], [0.001, 0.001, np.nan])
    assert_array_equal(table.command[1], [500, 501, 503])
    assert np.isnan(table.command[2]).all()
    assert np.isnan(table.target[2]).all()
    assert_array_equal(table.orientation_measured[0], [0, 0, 0, 1])
    assert_array_equal(table.orientation_command[0], [0, 0, 1, 0])
    assert_array_equal(table.time_s, [0.5, 1.5, 2.5])
    assert_array_equal(table.temp_c, [20.5, 20.6, 20.7])
    assert table.joints == 3


def test_standard_deviations_of_zero_are_left_out_with_a_warning(tmp_path: Path) -> None:
    stated = ["0.001,0.002,0.003", "0,0,0", "0.001,0.002,0.003", "0,0,0"] * 5
    rows = [f"{number},0,300,{number},0,300,{std}" for number, std in enumerate(stated)]
    table = read_table(write(tmp_path, csv(*rows, header=f"{HEADER},x_std,y_std,z_std")))
    (warning,) = [line for line in table.understood.lines if line.startswith("warning")]
    assert warning.startswith("warning: x_std is 0 in 10 rows, first row 3: no scatter is known there")
    noise = noise_from_std(table, np.eye(3)[None], np.zeros(table.rows, dtype=int))
    assert noise is not None
    np.testing.assert_allclose(np.sqrt(np.diag(noise.covariance)), [0.001, 0.002, 0.003], rtol=1e-6)
    assert noise_from_std(table.replace(std=0.0 * table.std), np.eye(3)[None], np.zeros(table.rows, dtype=int)) is None


def test_empty_reading_keeps_its_place(tmp_path: Path) -> None:
    rows = [ROWS[0], "10,0,300,,,", "10,5,300,1,,3", ROWS[2]]
    table = read_table(write(tmp_path, csv(*rows)))
    assert table.observed.tolist() == [True, False, True, True]
    assert_array_equal(table.measured[2], [1, np.nan, 3])
    assert table.rows == 4


def test_equal_rows_without_reading_are_travel(tmp_path: Path) -> None:
    table = read_table(write(tmp_path, csv(ROWS[0], "10,0,300,,,", ROWS[1], "10,0,300,,,")))
    assert table.observed.tolist() == [True, False, True, False]


def test_unknown_columns_are_kept_aside(tmp_path: Path) -> None:
    text = csv(*[f"{row},{note},1.50" for row, note in zip(ROWS, "abc", strict=True)], header=HEADER + ",operator,rms")
    table = read_table(write(tmp_path, text))
    assert table.understood.ignored == ("operator", "rms")
    assert table.extra["operator"].tolist() == ["a", "b", "c"]
    assert "not used: operator, rms" in str(table.understood)
    assert table_to_frame(table)["rms"].tolist() == ["1.50"] * 3


def test_comments_blank_lines_and_quotes(tmp_path: Path) -> None:
    text = f'# made by hand\n\n{HEADER},name\n{ROWS[0]},"a,b"\n\n// later\n{ROWS[1]},"say ""x"""\r\n{ROWS[2]},c\n\n'
    table = read_table(write(tmp_path, text))
    assert table.name.tolist() == ["a,b", 'say "x"', "c"]
    assert_array_equal(table.line, [4, 7, 8])


def test_rows_with_a_part_of_a_reading_are_told(tmp_path: Path) -> None:
    lines = str(read_table(write(tmp_path, csv("1,2,3,,5,6", "1,2,4,4,5,6", "1,2,5,4,,6", "1,2,6,,,"))).understood)
    told = "have no x_meas or y_meas although the other axes are filled: treated as no reading"
    assert f"warning: 2 rows, first row 2, {told}" in lines
    assert "no x_meas" not in str(read_table(write(tmp_path, csv("1,2,3,4,5,6", "1,2,6,,,"))).understood)
    assert "warning: row 3 has no z_meas although" in str(
        read_table(write(tmp_path, csv("1,2,3,4,5,6", "1,2,6,4,5,"))).understood
    )


BAD = {
    "text": (
        csv(ROWS[0], "1,2,3,--,5,6"),
        "run.csv row 3, column x_meas: not a number ('--'); leave the cell empty: the row keeps",
    ),
    "stamp": (
        csv(*(f"{row},2026-03-01 09:00:0{second}" for second, row in enumerate(ROWS)), header=HEADER + ",time_s"),
        "row 2, column time_s: not a number ('2026-03-01 09:00:00'); call the column 'time'",
    ),
    "nan": (csv(ROWS[0], "1,2,3,nan,5,6"), "row 3, column x_meas: not a number ('nan')"),
    "infinite": (csv(ROWS[0], "1,2,3,4,inf,6"), "row 3, column y_meas: not a number ('inf')"),
    "too large": (csv(ROWS[0], "1,2,3,4,1e999,6"), "row 3, column y_meas: not a number ('1e999')"),
    "boolean": (csv("1,2,3,True,5,6", "1,2,4,False,5,6"), "row 2, column x_meas: not a number ('True')"),
    "decimal comma": (
        csv(ROWS[0], '1,2,3,"4,5",5,6'),
        "row 3, column x_meas: not a number ('4,5'); write numbers with a",
    ),
    "decimal commas": (
        csv(ROWS[0], "1,2,3,4,5,5,6"),
        "row 3: 7 cells where 6 are expected; write numbers with a decimal",
    ),
    "infinite target": (csv(ROWS[0], "1,inf,3,4,5,6"), "row 3, column y_cmd: not a number ('inf'); write the target"),
    "titles again": (
        csv(ROWS[0], HEADER, ROWS[1]),
        "row 3, column x_cmd: not a number ('x_cmd'); this looks like the row",
    ),
    "short row": (csv(ROWS[0], "1,2,3,4,5"), "row 3: 5 cells where 6 are expected"),
    "missing reading": (
        csv("1,2,3", "1,2,4", header="x_cmd,y_cmd,z_cmd"),
        "columns are missing: x_meas, y_meas, z_meas",
    ),
    "missing z_meas": (csv("1,2,3,4,5", header=HEADER[:-7]) + "1,2,4,4,5\n", "column is missing: z_meas"),
    "missing command": (
        csv("1,2,3", "1,2,4", header="x_meas,y_meas,z_meas"),
        "x_cmd, y_cmd, z_cmd (neither they nor b1_cmd",
    ),
    "an arm's commands": (
        csv("1,2,1,2,3", "1,2,1,2,4", header="q1_cmd_rad,q2_cmd_rad,x_meas,y_meas,z_meas"),
        "the commands are q1_cmd_rad, q2_cmd_rad, and the machine is a 3-PTT, whose sliders are b1 to b3",
    ),
    "an arm's commands beside targets": (
        csv(
            *["1,2,3,1,2,3,1,2,3,4,5,6"] * 2,
            header="x_meas,y_meas,z_meas,x_cmd,y_cmd,z_cmd,"
            "q1_cmd_rad,q2_cmd_rad,q3_cmd_rad,q4_cmd_rad,q5_cmd_rad,q6_cmd_rad",
        ),
        "run and machine do not belong together",
    ),
    "part of the target": (csv("1,2,3,4", "1,2,4,4", header="x_cmd,x_meas,y_meas,z_meas"), "missing: y_cmd, z_cmd"),
    "part of the joints": (
        csv("1,2,1,2,3", "1,2,1,2,4", header="b1_cmd,b2_cmd,x_meas,y_meas,z_meas"),
        "column is missing: b3_cmd",
    ),
    "too many joints": (
        csv("1,2,3,4,1,2,3", "1,2,3,4,1,2,4", header="b1_cmd,b2_cmd,b3_cmd,b4_cmd,x_meas,y_meas,z_meas"),
        "column b4_cmd for a machine of 3 joints",
    ),
    "empty file": ("", "run.csv: the file is empty"),
    "only comments": ("# nothing\n\n", "run.csv: the file is empty"),
    "header only": (csv(), "run.csv: only a header, no rows"),
    "one row": (csv(ROWS[0]), "run.csv row 2: only one row"),
    "empty command": (csv(ROWS[0], "1,,3,4,5,6"), "row 3, column y_cmd: empty target; fill in where the tool"),
    "empty joint": (
        csv("1,,3,1,2,3", "1,2,3,4,1,2", header="b1_cmd,b2_cmd,b3_cmd,x_meas,y_meas,z_meas"),
        "row 2, column b2_cmd: empty command",
    ),
    "direction": (
        csv(ROWS[0] + ",1", ROWS[1] + ",2", header=HEADER + ",dir1"),
        "row 3, column dir1: not a direction (2)",
    ),
    "role": (
        csv(ROWS[0] + ",pose", ROWS[1] + ",home", header=HEADER + ",role"),
        "row 3, column role: unknown role 'home'",
    ),
    "std": (
        csv(ROWS[0] + ",-1", ROWS[1] + ",1", header=HEADER + ",x_std"),
        "column x_std: negative standard deviation (-1)",
    ),
    "quaternion": (
        csv(*(f"{row},0,0,0,{w}" for row, w in zip(ROWS, (1, 1.004, 2), strict=False)), header=f"{HEADER},{TURN}"),
        "row 4, column qx_meas: the quaternion qx_meas, qy_meas, qz_meas, qw_meas has length 2, not 1; write",
    ),
    "no quaternion": (
        csv(*(f"{row},0,0,0,0" for row in ROWS), header=f"{HEADER},{TURN}"),
        "row 2, column qx_meas: the quaternion qx_meas, qy_meas, qz_meas, qw_meas has length 0",
    ),
    "twice": (csv(ROWS[0] + ",1", ROWS[1] + ",1", header=HEADER + ",x_meas"), "column x_meas appears twice"),
    "metres": (
        csv("0,0,300,0,0,.3", "99,0,300,.1,0,.3", "0,99,300,0,.1,.3"),
        "this looks like metres; rename the columns",
    ),
    "metres target": (csv("0,0,.3,0,0,300", ".1,0,.3,99,0,300", "0,.1,.3,0,99,300"), "x_cmd, y, z spread over 0.1 mm"),
    "inches": (
        csv("0,0,0,0,0,0", "254,0,0,10,0,0", "0,254,0,0,10,0"),
        "looks like inches; rename the columns (x_meas_in)",
    ),
    "micrometres": (
        csv("0,0,0,0,0,0", "30,0,0,30000,0,0", "0,30,0,0,30000,0"),
        "like micrometres; rename the columns (x_meas_um)",
    ),
    "binary": ("\x00\x01\x02\x03" * 40, "run.csv row 1: not a text file: a character of code 1; export"),
    "one zero byte": (csv(ROWS[0], ROWS[1].replace("1", "\x00", 1)), "row 3: not a text file: a character of code 0"),
}


@pytest.mark.parametrize("text, message", BAD.values(), ids=BAD.keys())
def test_bad_input(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(TableError) as caught:
        read_table(write(tmp_path, text))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2
    assert caught.value.fix


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(TableError, match=r"no\.csv: no such file"):
        read_table(tmp_path / "no.csv")


def test_targets_file(tmp_path: Path) -> None:
    path = write(tmp_path, csv("0,0,300", "0,0,300", header="x,y,z"), "targets.csv")
    table = read_table(path, purpose="targets")
    assert_array_equal(table.target, [[0, 0, 300], [0, 0, 300]])
    assert not table.observed.any()
    assert read_table(write(tmp_path, csv("1,2,3", header="x_cmd,y_cmd,z_cmd")), purpose="targets").rows == 1


def test_sliders_file_sends_the_corrected_commands(tmp_path: Path) -> None:
    header = "x_cmd,y_cmd,z_cmd,b1_cmd,b2_cmd,b3_cmd,b1,b2,b3,status"
    text = csv("0,0,300,1,2,3,1.1,2.1,3.1,ok", "0,0,301,2,3,4,2.1,3.1,4.1,ok", header=header)
    path = write(tmp_path, text, "sliders.csv")
    assert_array_equal(read_table(path, purpose="sliders").command[0], [1.1, 2.1, 3.1])
    assert_array_equal(read_table(path, purpose="targets").command[0], [1, 2, 3])
    angles = write(tmp_path, csv("1.5,2", header="q1,q2"), "angles.csv")
    assert_array_equal(read_table(angles, 2, joint_prefix="q", purpose="sliders").command[0], [1.5, 2])
    with pytest.raises(TableError, match="missing: b1, b2, b3"):
        read_table(write(tmp_path, csv("1,2,3", header="x_cmd,y_cmd,z_cmd")), purpose="sliders")


def test_run_with_two_kinds_of_commands_is_asked(tmp_path: Path) -> None:
    header = "b1_cmd,b2_cmd,b3_cmd,b1,b2,b3,x_meas,y_meas,z_meas"
    path = write(tmp_path, csv("1,2,3,1.1,2.1,3.1,4,5,6", "2,3,4,2.1,3.1,4.1,5,6,7", header=header))
    with pytest.raises(TableError, match="which columns were sent to the machine"):
        read_table(path)
    assert read_table(path, ask=lambda question, choices: choices[1]).command[0, 0] == 1.1
    assert read_table(path, ask=lambda question, choices: choices[0]).command[0, 0] == 1.0
