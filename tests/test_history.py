"""History: one entry per step, enough to draw the ladder again; the commands that write it."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from command_line import invoke
from made_runs import KNOWN, hidden_backlash

from ptt.errors import MachineError
from ptt.files import sha256
from ptt.judge.history import read_entries, record, runs_of
from ptt.judge.ladder.climb import climb
from ptt.machine import format_machine, load_machine, parse_machine, save_machine
from ptt.model.model import Model
from ptt.run.problem import Problem
from ptt.run.written import write_table
from ptt.show.plots.common import png
from ptt.show.plots.ladder import draw_history, draw_ladder


@pytest.fixture(scope="module")
def problem() -> Problem:
    return hidden_backlash(120)[0]


@pytest.fixture(scope="module")
def folder(problem: Problem, tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("history")
    write_table(problem.table, place / "run.csv")
    save_machine(replace(problem.file, text=""), place / "m.toml")
    return place


def test_a_ladder_is_drawn_again_from_the_file(problem: Problem, folder: Path) -> None:
    ladder = climb(Model(problem.file), problem, [KNOWN["backlash"](), KNOWN["link-length"]()])
    file = parse_machine(format_machine(record(ladder, "add", [folder / "run.csv"], date="2024-05-01T12:00:00+00:00")))
    entries = read_entries(file)
    assert [(entry.effect, entry.kind, entry.helped) for entry in entries] == [
        ("backlash", "added", True),
        ("link-length", "added", False),
    ]
    for entry, before, step in zip(entries, ladder.steps, ladder.steps[1:], strict=False):
        assert entry.before_um == before.rms_um and entry.after_um == step.rms_um
        assert entry.heldout_before_um == before.heldout_rms_um and entry.heldout_after_um == step.heldout_rms_um
    assert entries[0].files == ({"file": "run.csv", "sha256": sha256(folder / "run.csv")},)
    assert entries[0].noise_um["source"] == "machine file"
    assert entries[0].rows == 119  # less the first, at which nobody knows from which side the machine came
    assert len(runs_of(entries)) == 1
    assert png(draw_ladder(ladder)) == png(draw_history(entries))


def test_a_run_of_one_pose_is_refused_where_nothing_can_be_held_out(problem: Problem, tmp_path: Path) -> None:
    table = problem.table
    save_machine(replace(problem.file, text=""), tmp_path / "m.toml")
    rows = [",".join(map(str, (*table.target[3], *(table.measured[3] + 1e-4 * k)))) for k in range(30)]
    (tmp_path / "one.csv").write_text("\n".join(["x_cmd,y_cmd,z_cmd,x_meas,y_meas,z_meas", *rows]) + "\n")
    words = ["one.csv", "--model", "m.toml", "--out", "n.toml"]
    for verb in (["add", words[0], "homing-offset", *words[1:]], ["fit", *words]):
        outcome = invoke(*(tmp_path / word if "." in word else word for word in verb))
        assert outcome.exit_code == 3 and "one.csv: no reading can be held out" in outcome.stderr
    assert not (tmp_path / "n.toml").exists()


def test_parameters_are_kept_as_they_were_before(problem: Problem, folder: Path) -> None:
    ladder = climb(Model(problem.file), problem, [KNOWN["backlash"](), KNOWN["link-length"]()])
    first, second = record(ladder, "add", [folder / "run.csv"]).history
    assert first["parameters_before"] == {}
    assert second["parameters_before"]["backlash"]["gap_mm"] == ladder.steps[1].fitted.model.terms[0].theta[:3].tolist()


def test_a_damaged_entry_is_refused_and_a_persons_own_is_left_alone(problem: Problem) -> None:
    head = format_machine(problem.file)
    assert read_entries(parse_machine(head + '\n[[history]]\nnote = "greased the screws"\n')) == ()
    with pytest.raises(MachineError, match="history entry without 'date'"):
        read_entries(parse_machine(head + '\n[[history]]\nkind = "added"\n'))
    entry = record(climb(Model(problem.file), problem, [KNOWN["backlash"]()]), "add", [{"file": "a", "sha256": "b"}])
    broken = replace(entry, history=({**entry.history[0], "rows": "many"},))
    with pytest.raises(MachineError, match=r"history entry that cannot be read .*'many'"):
        read_entries(broken)


def test_add_then_remove_then_fit_on_the_command_line(folder: Path) -> None:
    out, back = folder / "m2.toml", folder / "m3.toml"
    add = ("add", folder / "run.csv", "backlash", "link-length")
    done = invoke(*add, "--model", folder / "m.toml", "--out", out, "--json")
    assert done.exit_code == 0, done.output
    figures = json.loads(done.stdout)
    assert [step["effect"] for step in figures["steps"]] == ["as given", "backlash", "link-length"]
    assert [step.get("helped") for step in figures["steps"]] == [None, True, False]
    assert set(figures["steps"][0]["rms_um"]) == set(figures["steps"][0]["heldout_rms_um"]) == {"x", "y", "z", "total"}
    assert figures["noise_um"]["source"] == "machine file" and len(figures["parameters"]) == 6
    assert [entry.name for entry in load_machine(out).effect] == ["backlash", "link-length"]
    done = invoke(
        "remove", folder / "run.csv", "link-length", "--model", out, "--out", back, "--plots", folder / "plots"
    )
    assert done.exit_code == 0 and "link-length was not needed" in done.stdout
    assert (folder / "plots" / "ladder.png").stat().st_size > 10_000
    assert [entry.kind for entry in read_entries(load_machine(back))] == ["added", "added", "refit", "removed"]
    done = invoke("fit", folder / "run.csv", "--model", back)
    assert done.exit_code == 0 and "gap_mm 1" in done.stdout


@pytest.mark.parametrize(
    ("effect", "line", "code"),
    [
        ("backlsh", "effect 'backlsh' is not known; did you mean 'backlash'", 2),
        ("screw-growth", "this run cannot test 'screw-growth'", 3),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(folder: Path, effect: str, line: str, code: int) -> None:
    cold = folder / "cold.csv"
    text = (folder / "run.csv").read_text().splitlines()
    keep = [i for i, name in enumerate(text[0].split(",")) if name != "temp_c"]
    cold.write_text("\n".join(",".join(row.split(",")[i] for i in keep) for row in text) + "\n")
    out = folder / "never.toml"
    failed = invoke("add", cold, effect, "--model", folder / "m.toml", "--out", out)
    assert failed.exit_code == code and not out.exists()
    last = failed.stderr.strip().splitlines()[-1]
    assert last.startswith("error: ") and line in last
