"""What no machine is off by is looked for once more without it, and stays where nothing else says as much."""

from dataclasses import replace

import pytest

from ptt.challenge.challenge import bench as bench_machine
from ptt.challenge.truth import table_of
from ptt.diagnosis.evidence.possible import beyond_machines
from ptt.diagnosis.search import find as finding
from ptt.diagnosis.search.find import find
from ptt.diagnosis.search.found import Found
from ptt.effects import library
from ptt.model.model import Model
from ptt.rig.draw import draw_rig
from ptt.rig.simulate import simulate
from ptt.run.problem import Problem, build_problem

MACHINE = bench_machine()


def leaning(mrad: float) -> Problem:
    """Readings of a machine with one tower that leans."""
    drawn = draw_rig(4, MACHINE, "volume", rows=120)
    geometry = drawn.rig.geometry.model_copy(update={"lean_radial_mrad": (mrad, 0.0, 0.0)})
    rig = replace(drawn.rig, geometry=geometry)
    return build_problem(MACHINE, table_of(simulate(rig, drawn.targets).frame, drawn.absent))


def found_in(problem: Problem) -> Found:
    return find(Model(MACHINE), problem, library(), lambda what: None)


def away(found: Found) -> tuple[str, ...]:
    return beyond_machines(found.state, found.system.atoms, found.system.scale)


@pytest.mark.parametrize(("mrad", "far"), [(2.0, ()), (50.0, ("tower-tilt",))])
def test_a_drawing_may_be_off_by_what_no_machine_is(mrad: float, far: tuple[str, ...]) -> None:
    found = found_in(leaning(mrad))
    assert found.state.keys == ("tower-tilt",) and away(found) == far


@pytest.fixture
def barred(monkeypatch: pytest.MonkeyPatch) -> list[frozenset[str]]:
    """What each search is not to say, the first one made to miss the tilt, as one does that was led astray."""
    begun, told = finding._searched, list[frozenset[str]]()

    def led_astray(asked, first):
        told.append(frozenset(first.barred))
        return begun(asked, first if first.barred else replace(first, barred=frozenset({"tower-tilt"})))

    monkeypatch.setattr(finding, "_searched", led_astray)
    return told


def test_what_stands_in_at_absurd_values_gives_way(barred: list[frozenset[str]], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(finding, "_beyond_machines", lambda found: ("guide-straightness",))
    assert found_in(leaning(2.0)).state.keys == ("tower-tilt",)
    assert barred == [frozenset(), frozenset({"guide-straightness"})]


def test_what_is_found_instead_is_asked_the_same(barred: list[frozenset[str]], monkeypatch: pytest.MonkeyPatch):
    """Neither is to be said then; a second name that was beyond machines at first is none of what is found."""

    first, then = ("guide-straightness", "windup"), ("tower-tilt",)
    monkeypatch.setattr(finding, "_beyond_machines", lambda found: then if "tower-tilt" in found.state.keys else first)
    assert found_in(leaning(2.0)).state.keys == ("tower-tilt",)  # what is found without it says less
    assert barred[:2] == [frozenset(), frozenset({"guide-straightness"})]
    assert barred[2] == frozenset({"guide-straightness", "tower-tilt"})


@pytest.mark.parametrize(("share", "against"), [(2.5e-4, False), (4e-4, True), (-4e-4, True)])
def test_a_tracker_that_leaves_out_the_air_reads_three_tenths_of_a_mm_too_long_at_the_most(share, against) -> None:
    drawn = draw_rig(4, MACHINE, "volume", rows=120)
    problem = build_problem(MACHINE, table_of(simulate(drawn.rig, drawn.targets).frame, drawn.absent))
    longer = replace(problem, measured=problem.measured * (1.0 + share))
    found = find(Model(MACHINE), longer, library(), lambda what: None)
    key = next(key for key, atom in found.system.atoms.items() if atom.name == "tracker-scale")
    state = found.scorer.score((key,), found.state.memory)
    assert (state.forms[key] < -20.0) is against


def test_friction_takes_no_more_than_half_the_travel_that_it_takes() -> None:
    """Play of millimetres is no wind-up over as few, which would say much the same."""
    drawn = draw_rig(4, MACHINE, "volume", rows=120)
    drive = drawn.rig.drive.model_copy(update={"backlash_mm": (6.0, 4.0, 5.0)})
    rig = replace(drawn.rig, drive=drive)
    found = found_in(build_problem(MACHINE, table_of(simulate(rig, drawn.targets).frame, drawn.absent)))
    atoms = {atom.key: atom for atom in found.system.atoms.values() if atom.name == "windup"}
    usual = library()["windup"].parameters[0].usual
    for atom in atoms.values():
        assert atom.shape is not None and atom.largest is not None
        assert atom.largest == pytest.approx(0.5 * float(atom.shape["length"][0]) / usual)
    short = min(atoms, key=lambda key: float((atoms[key].shape or {})["length"][0]))
    state = found.scorer.score((short,), found.state.memory)
    assert beyond_machines(state, found.system.atoms, found.system.scale) == (short,)
