"""What all exports share: names of formats, files that appear together, the error that is left."""

import platform
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

import ptt
from ptt.commands.main import run
from ptt.correct.exports.format import Options
from ptt.correct.exports.head import head_lines
from ptt.correct.exports.held import _reason
from ptt.correct.exports.left import error_left, holdings, sample_workspace
from ptt.correct.exports.registry import FORMATS, find_format, writer
from ptt.correct.exports.whole import write_all
from ptt.correct.training.compensator import Compensator
from ptt.effects.drive import HomingOffset
from ptt.effects.reversal import Backlash
from ptt.errors import InputError
from ptt.machine import MachineFile, save_machine
from ptt.machine_schema import ControllerSpec
from ptt.mechanisms import build_mechanism
from ptt.model.entries import write_model
from ptt.model.model import Model, Term

ZEROS = torch.tensor([0.2, -0.1, 0.05], dtype=torch.float64)
GAPS = torch.tensor([0.04, 0.06, 0.02], dtype=torch.float64)


def _model(file: MachineFile) -> Compensator:
    model = Model(file) + Term(HomingOffset(), ZEROS) + Term(Backlash(), torch.cat([GAPS, torch.ones(1)]))
    return Compensator(model, None, {})


def test_an_unknown_format_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(InputError, match=r"no export format 'tabel'.*did you mean 'table'"):
        find_format("tabel")


def test_a_format_of_other_machines_is_refused() -> None:
    klipper = next(each for each in FORMATS if each.name == "klipper")
    with pytest.raises(InputError, match="not for a serial machine"):
        writer(klipper, "serial")


def test_nothing_is_written_where_one_file_of_several_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    (tmp_path / "mine").write_text("kept")
    with pytest.raises(InputError, match="is a folder"):
        write_all({tmp_path / "a": "1", tmp_path / "b": "2"})
    assert sorted(each.name for each in tmp_path.iterdir()) == ["b", "mine"]
    assert write_all({tmp_path / "a": "1", tmp_path / "c": b"2"}) == (tmp_path / "a", tmp_path / "c")
    assert (tmp_path / "a").read_text() == "1"


def test_a_link_is_written_through_and_the_dead_are_swept(tmp_path: Path) -> None:
    (tmp_path / "way.cfg").symlink_to("there.cfg")
    left = tmp_path / f".there.cfg.{platform.node().replace('.', '-')}.{2**22 - 1}.x"  # of a process that is gone
    left.write_text("half")
    write_all({tmp_path / "way.cfg": "whole"})
    assert (tmp_path / "way.cfg").is_symlink() and (tmp_path / "there.cfg").read_text() == "whole"
    assert sorted(each.name for each in tmp_path.iterdir()) == ["there.cfg", "way.cfg"]


def test_errors_left_are_those_of_a_machine_worked_out_by_hand(bench: MachineFile) -> None:
    compensator = _model(bench)
    sample = sample_workspace(compensator, Options(), 200)
    left = error_left(sample, sample.static)
    assert left.model < 1e-3 < left.format < left.drawing
    # Without reversal compensation each slider stays half a gap behind: dp = J^-1 (gap / 2), signs as they come.
    jacobian = build_mechanism(bench.machine).jacobian(torch.as_tensor(sample.nominal)).numpy()
    square = np.einsum("nck,k->n", jacobian**2, (GAPS.numpy() / 2.0) ** 2)
    assert left.format == pytest.approx(1e3 * np.sqrt(square.mean()), rel=0.2)
    whole = np.einsum("nck,k->nc", jacobian, ZEROS.numpy())
    both = np.sqrt(((whole**2).sum(axis=1) + square).mean())
    assert left.drawing == pytest.approx(1e3 * both, rel=0.1)


def test_what_is_uncertain_is_in_all_three_figures(bench: MachineFile) -> None:
    """Nothing is left of the model's own commands but what its parameters leave uncertain: 3 um, at every place."""
    sample = sample_workspace(_model(bench), Options(), 60)
    sure = error_left(sample, sample.static)
    unsure = replace(sample, commands=replace(sample.commands, sigma=np.full(len(sample.targets), 3e-3)))
    left = error_left(unsure, sample.static)
    assert left.model == pytest.approx(3.0, abs=1e-3)
    assert (left.format, left.drawing) == pytest.approx((np.hypot(sure.format, 3.0), np.hypot(sure.drawing, 3.0)))


@pytest.mark.parametrize(("left", "held"), [(0.04, True), (0.06, False)])
def test_an_effect_counts_as_held_where_a_twentieth_of_it_is_left_at_most(left: float, held: bool) -> None:
    moved = np.random.default_rng(0).normal(0.0, 0.1, 90)
    said = _reason(HomingOffset(), moved, left * moved, "no room for it", (), untold=False)
    assert said == "" if held else said.startswith("no room for it")


def test_what_the_controller_compensates_is_neither_held_nor_counted(bench: MachineFile) -> None:
    compensator = _model(replace(bench, controller=ControllerSpec(compensates=("backlash",))))
    sample = sample_workspace(compensator, Options(), 60)
    holds, cannot = holdings(sample, {"column-bend": "not in the model"})
    assert holds == ("homing-offset",)
    assert [item.effect for item in cannot] == ["backlash"]
    assert error_left(sample, sample.static).format < 1e-3


def test_the_head_names_model_and_digest_without_ending_a_comment(bench: MachineFile, tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text("x")
    machine = bench.machine.model_copy(update={"name": "big */ one\n(µ)"})
    compensator = Compensator(Model(replace(bench, machine=machine)), None, {})
    text = "\n".join(head_lines(compensator, Options(path)))
    assert "2d711642b726b04401627ca9fbac32f5c8530fb1903cc4db02258717921a4881" in text  # sha256sum of an x
    assert "*/" not in text
    assert ")" not in text
    assert text.isascii()
    assert len(text.splitlines()) == 2


def test_how_a_run_is_read_is_refused_where_none_is_named(
    bench: MachineFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save_machine(bench, tmp_path / "m.toml")
    words = ["export", "--model", str(tmp_path / "m.toml"), "--to", "klipper", "--out", str(tmp_path / "printer.cfg")]
    assert run([*words, "--set", "payload_kg=2"]) == 2
    assert "--set: says how to read a run, but no run is named; add --run RUN.csv" in capsys.readouterr().err
    assert not (tmp_path / "printer.cfg").exists()


def test_a_model_is_not_written_over_by_the_command_nor_by_the_library(
    bench: MachineFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "m.toml"
    save_machine(bench, path)
    before = path.read_bytes()
    assert run(["export", "--model", str(path), "--to", "klipper", "--out", str(tmp_path / "." / "m.toml")]) == 2
    assert "is the input" in capsys.readouterr().err
    with pytest.raises(InputError, match="is the model itself; nothing was written"):
        ptt.export(path, "klipper", tmp_path / "." / "m.toml")
    assert path.read_bytes() == before


@pytest.mark.parametrize(("frame", "free"), [("fitted", True), ("fitted-per-run", True), ("trusted", False)])
def test_an_export_of_a_model_that_was_fitted_beside_a_free_frame_says_so(
    bench: MachineFile, frame: str, free: bool, tmp_path: Path
) -> None:
    file = replace(bench, text="", tracker=bench.tracker.model_copy(update={"frame": frame}))
    save_machine(write_model(_model(file).model), tmp_path / "m.toml")
    told = ptt.export(tmp_path / "m.toml", "klipper", tmp_path / "printer.cfg").to_dict()["notes"]
    assert any("together with the tracker's frame" in note for note in told) == free
