"""Set-up mistakes of serial arms, on arms whose truth comes from the virtual machine."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ptt.machine import MachineFile, SerialSpec, load_machine, parse_machine
from ptt.mechanisms import build_mechanism
from ptt.rig.draw_arm import draw_arm
from ptt.run.table import Table, make_table, take_rows
from ptt.setup import check_setup
from ptt.setup.machine import describe_machine

MACHINES = Path(__file__).parent.parent / "data" / "machines"
Change = Callable[[Table], Table]


def arm(name: str, fault: str = "link", seed: int = 1) -> tuple[MachineFile, Table]:
    file = load_machine(MACHINES / f"{name}.toml")
    run = draw_arm(file.machine, fault, seed)  # type: ignore[arg-type]
    table = make_table(
        None, run.q, run.readings, joint_prefix="q", temp_c=run.temp_c, payload_kg=run.payload_kg, time_s=run.time_s
    )
    return file, table


def sent(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda table: table.replace(command=change(np.asarray(table.command)))


def read(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda table: table.replace(measured=change(table.measured))


def two_swapped(q: np.ndarray) -> np.ndarray:
    order = np.arange(q.shape[1])
    order[[1, 2]] = 2, 1
    return q[:, order]


def one_turned(q: np.ndarray) -> np.ndarray:
    return q * np.where(np.arange(q.shape[1]) == 2, -1.0, 1.0)


def one_zero(q: np.ndarray) -> np.ndarray:
    return q + np.where(np.arange(q.shape[1]) == 1, np.pi / 2.0, 0.0)


CASES = {
    "two joints interchanged": (sent(two_swapped), {"joint-order"}),
    "a joint turning the other way": (sent(one_turned), {"joint-sign"}),
    "a zero off by 90 deg": (sent(one_zero), {"joint-sign"}),
    "degrees in rad columns": (sent(np.degrees), {"angle-unit"}),
    "radians in deg columns": (sent(np.radians), {"angle-unit"}),
    "mirrored readings": (read(lambda p: p * [1.0, 1.0, -1.0]), {"axis-sign", "axes-swapped"}),
    "readings in inches": (read(lambda p: p / 25.4), {"unit-scale"}),
    "readings a row late": (read(lambda p: np.vstack([p[:1], p[:-1]])), {"row-shift"}),
}


@pytest.mark.parametrize("name", ["ur10", "kuka_iiwa"])
@pytest.mark.parametrize("title", CASES)
def test_mistakes_of_an_arm_are_named_and_cured(title: str, name: str) -> None:
    change, names = CASES[title]
    file, table = arm(name)
    found = check_setup(file, change(table))
    assert found.findings[0].mistake in names, str(found)
    assert found.findings[0].sure
    assert found.findings[0].after_um is not None
    assert found.findings[0].after_um < 100.0
    assert found.table is not None
    assert check_setup(found.file, found.table).ok


def drawn_in(file: MachineFile, factor: float, *, tool: bool = True) -> MachineFile:
    """The machine file as someone writes it who has its lengths in a unit of so many mm."""
    spec = file.machine
    assert isinstance(spec, SerialSpec)
    joints = tuple(
        each.model_copy(update={"a_mm": each.a_mm / factor, "d_mm": each.d_mm / factor}) for each in spec.joint
    )
    if any(each.com_mm for each in joints):
        joints = tuple(each.model_copy(update={"com_mm": scaled(each.com_mm, factor)}) for each in joints)
    own = scaled(spec.tool_mm, factor) if tool else spec.tool_mm
    return replace(file, machine=spec.model_copy(update={"joint": joints, "tool_mm": own}))


def scaled(place: tuple[float, float, float], factor: float) -> tuple[float, float, float]:
    x, y, z = (value / factor for value in place)
    return x, y, z


@pytest.mark.parametrize(
    ("unit", "factor", "change"),
    [
        ("metres", 1e3, None),
        ("inches", 25.4, None),
        ("centimetres", 10.0, None),  # an arm that size may be built: the lengths alone explain the readings
        ("metres", 1e3, "two joints interchanged"),
        ("inches", 25.4, "two joints interchanged"),
    ],
)
def test_a_machine_file_in_another_unit_is_no_run_in_micrometres(unit: str, factor: float, change: str | None) -> None:
    """The readings are those of an arm, and the drawing is not."""
    file, table = arm("kuka_iiwa")
    found = check_setup(drawn_in(file, factor), CASES[change][0](table) if change else table)
    assert [item.mistake for item in found.findings] == ["unit-scale", *(["joint-order"] if change else [])], str(found)
    assert all(item.sure and f"lengths taken as {unit}" in item.words for item in found.findings)
    assert found.findings[0].fix.startswith("write d_mm = ")
    assert isinstance(found.file.machine, SerialSpec) and isinstance(file.machine, SerialSpec)
    for one, other in zip(found.file.machine.joint, file.machine.joint, strict=True):
        assert (one.a_mm, one.d_mm) == pytest.approx((other.a_mm, other.d_mm), abs=1e-6)
    assert found.table is not None
    np.testing.assert_array_equal(found.table.measured, table.measured)


def test_a_tool_that_is_longer_than_all_links_is_in_mm_already() -> None:
    file, table = arm("kuka_iiwa")
    assert isinstance(file.machine, SerialSpec)
    long = replace(file, machine=file.machine.model_copy(update={"tool_mm": (30.0, 0.0, 80.0)}))
    (found,) = check_setup(drawn_in(long, 1e3, tool=False), table).findings
    assert found.mistake == "unit-scale" and "lengths taken as metres" in found.words


@pytest.mark.parametrize("trust", ["fitted", "trusted"])
@pytest.mark.parametrize(("unit", "factor"), [("centimetres", 10.0), ("inches", 25.4), ("metres", 1e3)])
@pytest.mark.parametrize("scaled", [False, True])
def test_a_tool_is_scaled_only_where_it_is_in_the_unit_of_the_links(
    unit: str, factor: float, trust: str, scaled: bool
) -> None:
    """A trusted one is where the readings say; of a fitted one its size tells."""
    file, _ = arm("kuka_iiwa")
    tool = (10.0, 0.0, 40.0)
    long = replace(file, machine=file.machine.model_copy(update={"tool_mm": tool}))
    long = replace(long, tracker=file.tracker.model_copy(update={"tool": trust}))
    table = of_tool(long)
    found = check_setup(drawn_in(long, factor, tool=scaled), table)
    assert [item.mistake for item in found.findings] == ["unit-scale"]
    assert isinstance(found.file.machine, SerialSpec)
    assert found.file.machine.tool_mm == pytest.approx(tool, abs=1e-6)
    (finding,) = found.findings
    assert f"lengths taken as {unit}" in finding.words
    assert ("tool_mm" in finding.words) == ("tool_mm" in finding.fix) == scaled


def test_centres_of_mass_are_in_the_unit_of_the_links() -> None:
    file, table = arm("kuka_iiwa")
    assert isinstance(file.machine, SerialSpec)
    heavy = tuple(
        each.model_copy(update={"mass_kg": 3.0, "com_mm": (0.0, 10.0 * row, 120.0)})
        for row, each in enumerate(file.machine.joint)
    )
    drawn = drawn_in(replace(file, machine=file.machine.model_copy(update={"joint": heavy})), 1e3)
    (remark,) = describe_machine(drawn).remarks
    assert remark.endswith("write a_mm, d_mm, com_mm in mm")
    found = check_setup(drawn, table)
    assert [item.mistake for item in found.findings] == ["unit-scale"]
    assert "com_mm" in found.findings[0].words and "com_mm" in found.findings[0].fix
    assert isinstance(found.file.machine, SerialSpec)
    for one, other in zip(found.file.machine.joint, heavy, strict=True):
        assert one.com_mm == pytest.approx(other.com_mm, abs=1e-6)


def of_tool(file: MachineFile) -> Table:
    """A run of an arm as drawn, its reflector at the tool point, read to a few micrometres."""
    random = np.random.default_rng(4)
    q = random.uniform(-1.5, 1.5, (60, file.machine.joints))
    place = build_mechanism(file.machine).forward(torch.as_tensor(q)).numpy()
    return make_table(None, q, place + 3e-3 * random.normal(size=place.shape), joint_prefix="q")


def test_links_of_no_arm_are_remarked_on_without_a_run() -> None:
    file, _ = arm("kuka_iiwa")
    assert describe_machine(file).remarks == () and "remark" not in str(describe_machine(file))
    said = describe_machine(drawn_in(file, 1e3))
    (remark,) = said.remarks
    assert "mm long together, as of no arm" in remark and "mm if in metres" in remark and "inches" not in remark
    assert str(said).endswith(f"remark: {remark}")
    (remark,) = describe_machine(drawn_in(file, 1e-3)).remarks
    assert "mm if in micrometres" in remark


@pytest.mark.parametrize("name", ["ur10", "kuka_iiwa"])
def test_an_arms_missed_reading_is_found_at_its_row(name: str) -> None:
    file, table = arm(name)
    missed = table.rows // 2
    early = np.vstack([np.delete(table.measured, missed, axis=0), np.full((1, 3), np.nan)])
    found = check_setup(file, table.replace(measured=early))
    assert [item.mistake for item in found.sure] == ["row-shift"]
    assert found.table is not None
    empty = np.flatnonzero(~np.isfinite(found.table.measured).all(axis=1))
    assert abs(int(empty[0]) - missed) <= 1  # repeats of a pose in a row may stand for each other
    assert check_setup(found.file, found.table).ok


def test_a_dozen_rows_of_an_arm_are_enough() -> None:
    file, table = arm("ur10")
    few = take_rows(table, np.linspace(0, table.rows - 1, 14).astype(int))
    assert check_setup(file, few).findings == ()
    assert check_setup(file, sent(np.degrees)(few)).sure[0].mistake == "angle-unit"
    assert "too little to judge" in str(check_setup(file, take_rows(few, np.arange(6))))


@pytest.mark.parametrize("fault", ["none", "link", "compliance", "backlash", "growth"])
@pytest.mark.parametrize("name", ["ur10", "kuka_iiwa", "assembly_robot"])
def test_sound_arms_are_not_accused(name: str, fault: str) -> None:
    assert check_setup(*arm(name, fault, 3)).findings == ()


def test_a_zero_is_cured_in_the_text_of_the_machine_file() -> None:
    file, table = arm("ur10")
    found = check_setup(file, sent(one_zero)(table))
    cured = parse_machine(found.file.text).machine
    assert cured.kind == "serial"
    assert cured.joint[1].theta_offset_deg == -90.0
    assert "Universal Robots" in found.file.text


def test_the_drawing_of_another_arm_does_not_hold_together() -> None:
    _, table = arm("ur10")
    for name, left in (("kuka_iiwa", "no arm is built that far off"), ("ur10", "")):
        file = load_machine(MACHINES / f"{name}.toml")
        joints = file.machine.joints
        q = np.column_stack([table.command, np.zeros((table.rows, 1))])[:, :joints]  # type: ignore[list-item]
        said = check_setup(file, table.replace(command=q))
        assert not said.findings and (left in said.unexplained if left else said.unexplained == "")


def test_the_other_convention_is_told_by_its_name() -> None:
    file, table = arm("ur10")
    text = file.text.replace('convention = "standard"', 'convention = "modified"')
    assert text != file.text
    said = check_setup(parse_machine(text), table)
    assert 'with convention = "standard" in the machine file' in said.unexplained and said.ok


def test_a_place_alone_does_not_tell_how_an_arm_stands() -> None:
    file, table = arm("ur10")
    said = check_setup(file, table.replace(command=None, target=table.measured))
    assert "no joint commands" in said.too_little


def test_reach_of_an_arm_is_said_within_its_limits() -> None:
    text = (
        '[machine]\nkind = "serial"\nname = "elbow"\nconvention = "standard"\n[[machine.joint]]\nd_mm = 400.0\n'
        "a_mm = 300.0\nlimits_deg = [-170, 170]\n[[machine.joint]]\na_mm = 250.0\nlimits_deg = [90, 170]\n"
    )
    said = describe_machine(parse_machine(text))
    assert "reach: at most 391 mm from the base's z axis; z from 400 to 400 mm (within" in str(said)
    reach = said.to_dict()["reach_mm"]
    assert reach["sideways"] == pytest.approx(np.hypot(300.0, 250.0)) and reach["z"] == pytest.approx([400.0, 400.0])


def test_a_target_that_is_reached_in_several_ways_is_no_repeat() -> None:
    """Seven joints reach one target in many poses, each with an error of its own: these tell nothing of the noise."""
    file, table = arm("kuka_iiwa")
    told = table.replace(target=np.zeros((table.rows, 3)), std=np.full((table.rows, 3), 1e-4))
    assert "noise-implausible" not in [finding.mistake for finding in check_setup(file, told).findings]
    twice = take_rows(told, np.repeat(np.arange(table.rows), 2))  # each pose is read twice, a tenth of a mm apart
    apart = np.where(np.arange(twice.rows) % 2, 0.05, -0.05)[:, None]
    twice = twice.replace(measured=twice.measured + apart)
    assert "noise-implausible" in [finding.mistake for finding in check_setup(file, twice).findings]
