"""The front door: `import ptt` costs nothing, says what the command line says, and refuses what it refuses."""

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch
from library_folder import DATA, ROOT
from library_folder import here as here
from matplotlib.figure import Figure

import ptt
from ptt.commands.main import run as command
from ptt.effects.registry import classes
from ptt.errors import InputError, PttError

VERBS_OF_SECTION_10 = (
    "load", "read", "read_targets", "check", "compare", "diagnose", "add", "remove", "fit", "train", "predict",
    "evaluate", "recheck", "export", "simulate", "effects", "Model", "Run",
)  # fmt: skip
COMMANDS = """
import contextlib, io, json, sys
from ptt.commands.main import run
said = []
for words in json.load(sys.stdin):
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        code = run([*words, "--json"])
    assert code == 0, words
    said.append(json.loads(out.getvalue()))
print(json.dumps(said))
"""


@pytest.fixture(scope="module")
def told(here) -> dict[str, Any]:
    """What the command line says with --json, in a process of its own."""
    run, machine, solved, sent = (str(here / name) for name in ("run.csv", "machine.toml", "solved.toml", "sent.csv"))
    rig = str(DATA / "rigs" / "bench.toml") if (DATA / "rigs" / "bench.toml").exists() else str(_some_rig())
    words = {
        "check": ["check", run, "--model", machine],
        "compare": ["compare", run, "--model", machine],
        "diagnose": ["diagnose", run, "--model", machine],
        "add": ["add", run, "backlash", "lead-scale", "--model", machine, "--out", solved],
        "fit": ["fit", run, "--model", solved],
        "remove": ["remove", run, "lead-scale", "--model", solved, "--out", str(here / "less.toml")],
        "train": ["train", run, "--machine", solved, "--out", str(here / "compensator")],
        "predict": ["predict", str(here / "targets.csv"), "--model", str(here / "compensator"), "--out", sent],
        "simulate": ["simulate", rig, str(DATA / "targets.csv"), "--out", str(here / "made.csv"), "--seed", "3"],
        "export": ["export", "--model", solved, "--to", "klipper", "--out", str(here / "printer.cfg")],
        "evaluate": ["evaluate", run, "--model", solved],
        "measured": ["evaluate", run, run],
    }
    ended = subprocess.run(
        [sys.executable, "-c", COMMANDS], input=json.dumps(list(words.values())), capture_output=True, text=True,
        check=False, cwd=ROOT,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stderr
    return dict(zip(words, json.loads(ended.stdout), strict=True)) | {"rig": rig}


def _some_rig() -> Path:
    return sorted((DATA / "rigs").glob("*.toml"))[0]


@pytest.fixture(scope="module")
def done(here, told) -> dict[str, Any]:
    """The same by the library, as a person writes it."""
    model = ptt.load(here / "machine.toml")
    run = ptt.read(here / "run.csv", model)
    solved = ptt.load(here / "solved.toml")
    ladder = ptt.add(model, run, "backlash", ptt.effects.LeadScale())
    comp = ptt.train(solved, run)
    comp.save(here / "compensator")
    out = ptt.predict(comp, ptt.read_targets(here / "targets.csv", model))
    out.to_csv(here / "sent.csv")
    made = ptt.simulate(told["rig"], DATA / "targets.csv", seed=3)
    made.to_csv(here / "made.csv")
    return {
        "check": ptt.check(model, run),
        "compare": ptt.compare(model, run),
        "diagnose": ptt.diagnose(model, run),
        "add": ladder,
        "fit": ptt.fit(solved, run),
        "remove": ptt.remove(solved, run, "lead-scale"),
        "train": comp,
        "predict": out,
        "simulate": made,
        "export": ptt.export(str(here / "solved.toml"), "klipper", here / "printer.cfg"),
        "evaluate": ptt.evaluate(solved, run),
        "measured": ptt.evaluate(here / "run.csv", run),
    }


VERBS = (
    "check", "compare", "diagnose", "add", "fit", "remove", "train", "predict", "simulate", "export", "evaluate",
    "measured",
)  # fmt: skip


def test_names_are_there_and_clash_with_no_room():
    assert set(VERBS_OF_SECTION_10) <= set(dir(ptt))
    assert all(getattr(ptt, name) is not None for name in VERBS_OF_SECTION_10)
    rooms = {path.stem for path in (ROOT / "ptt").iterdir()} - {"effects"}
    assert not rooms & set(VERBS_OF_SECTION_10), "a room with the name of a verb takes its place once it is imported"
    with pytest.raises(AttributeError, match="levitate"):
        ptt.levitate  # noqa: B018


def test_import_loads_nothing_heavy_and_takes_less_than_numpy_alone():
    code = (
        "import sys, time; start = time.process_time(); import ptt; dir(ptt); took = time.process_time() - start\n"
        "heavy = [m for m in ('torch', 'numpy', 'pandas', 'scipy') if m in sys.modules]\n"
        "start = time.process_time(); import numpy; print(took / (time.process_time() - start), heavy)"
    )
    shares = []
    for _ in range(3):
        said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        share, heavy = said.split(" ", 1)
        assert heavy.strip() == "[]"
        shares.append(float(share))
    assert min(shares) < 1.0


def test_effects_are_there_by_class_and_by_name():
    typed = (ROOT / "ptt" / "effects" / "__init__.py").read_text()
    for name, cls in classes().items():
        assert getattr(ptt.effects, name) is cls and f"import {name} as {name}" in typed
    assert ptt.effects.SetupJump("second").key == "setup-jump[second]"
    assert "ColumnBend" in dir(ptt.effects)


@pytest.mark.parametrize("verb", VERBS)
def test_figures_are_those_of_the_command_line_in_another_process(verb, told, done):
    assert done[verb].to_dict() == told[verb]


@pytest.mark.parametrize("verb", VERBS)
def test_every_result_reads_draws_and_tabulates(verb, done):
    result = done[verb]
    assert len(str(result)) > 20 and str(result) == repr(result)
    assert result._repr_html_().startswith("<pre>")
    assert isinstance(result.plot(), Figure)
    assert isinstance(result.to_frame(), pd.DataFrame)


@pytest.mark.parametrize(
    ("verb", "words"),
    [
        ("compare", ["compare", "run.csv", "--model", "machine.toml"]),
        ("check", ["check", "run.csv", "--model", "machine.toml"]),
        ("measured", ["evaluate", "run.csv", "run.csv"]),
    ],
)
def test_text_is_what_the_command_prints(verb, words, here, done, capsys):
    assert command([words[0], *(str(here / each) if "." in each else each for each in words[1:])]) == 0
    assert capsys.readouterr().out.rstrip("\n") == str(done[verb]).rstrip("\n")


def test_a_ladder_has_the_model_that_the_command_writes(here, done):
    model = done["add"].model
    model.save(here / "again.toml")
    mine, theirs = ((here / name).read_text().splitlines() for name in ("again.toml", "solved.toml"))
    assert [line for line in mine if "date" not in line] == [line for line in theirs if "date" not in line]
    assert model.effects == ("backlash", "lead-scale") and "backlash: gap_mm 1" in str(model)


def test_a_compensator_reads_back_as_it_was_saved(here, done):
    read = ptt.load(here / "compensator")
    read.save(here / "copy")
    targets = ptt.read_targets(here / "targets.csv", read)
    expected = done["predict"].b
    for model in (read, here / "copy"):
        np.testing.assert_array_equal(ptt.predict(model, targets).b, expected)


def test_data_frames_and_arrays_are_taken_as_files_are(here, done):
    model = ptt.load(here / "machine.toml")
    frame = pd.read_csv(here / "run.csv")
    run = ptt.read(frame, model, set={"payload_kg": 2})
    assert (run.table.payload_kg == 2).all() and len(run) == 120 and "data frame" in str(run)
    same = ptt.read(frame, model)
    np.testing.assert_array_equal(same.table.measured, ptt.read(here / "run.csv", model).table.measured)
    targets = done["predict"].table.target
    np.testing.assert_array_equal(
        ptt.predict(model, targets).b, ptt.predict(model, pd.DataFrame(targets, columns=["x_cmd", "y_cmd", "z_cmd"])).b
    )
    for given in (same, frame):  # nobody else keeps what was written of the second
        assert ptt.add(model, given, "backlash").model.file.history[0]["files"][0]["file"] == "frame.csv"


def test_a_run_of_the_virtual_machine_can_be_read(done):
    rig_machine = DATA / "machine.toml"
    assert len(ptt.read(done["simulate"], rig_machine)) == done["simulate"].to_dict()["rows"]


def test_wrong_arguments_get_words(here, done):
    model, run = ptt.load(here / "machine.toml"), ptt.read(here / "run.csv", here / "machine.toml")
    targets = ptt.read_targets([[0.0, 0.0, 0.0]], model)
    for call, words in (
        (lambda: ptt.diagnose(run, model), r"diagnose\(model, run\): got a Run where the model belongs"),
        (lambda: ptt.compare(model, model), r"compare\(model, run.*\): got a Model where the run belongs"),
        (lambda: ptt.compare(model, targets), "got a Targets where the run belongs"),
        (lambda: ptt.predict(model, run), "got a Run where targets belong"),
        (lambda: ptt.add(model, run), "no effect named"),
        (lambda: ptt.add(model, run, "backlahs"), "did you mean 'backlash'"),
        (lambda: ptt.add(model, run, 7), "7 is not an effect"),
        (lambda: ptt.predict(model, [[1.0, 2.0]]), r"an array \(n, 3\) in mm"),
        (lambda: ptt.load(7), "takes the path"),
        (lambda: ptt.evaluate(run, model), "exchange them"),
        (lambda: ptt.read(here / "run.csv", model, set="payload_kg=2"), "write it as set="),
        (lambda: ptt.train(model, run, hold_out="none"), "hold_out: 'none' is not one of 'blocks', 'random'"),
        (lambda: ptt.evaluate(run, run, frame="foo"), "frame: 'foo' is not one of 'fitted', 'fitted-per-run', 'tr"),
        (lambda: ptt.evaluate(run, run, z_datum="foo"), "z_datum: 'foo' is not one of 'absolute', 'first'"),
        (lambda: ptt.evaluate(run, run, goal=("a", 1, 2)), "goal: 'a' is not a finite number; give percent"),
        (lambda: ptt.predict(model, targets, reversal="hard"), "reversal: 'hard' is not one of 'software', 'none'"),
        (lambda: ptt.predict(model, targets, limit_mm=-1), "limit_mm: -1 is below 0"),
        (lambda: ptt.predict(model, targets, limit_mm=math.nan), "limit_mm: nan is not a finite number"),
        (lambda: ptt.diagnose(model, run, steps=0), "steps: 0 is below 1"),
        (lambda: ptt.diagnose(model, run, steps=2.5), r"steps: 2\.5 is not a whole number"),
        (lambda: ptt.diagnose(model, run, chunk_rows=5), "chunk_rows: 5 is below 1000"),
        (lambda: ptt.export(model, "siemens", here / "s.spf", step=-3), "step: -3 is below 1e-06"),
        (lambda: ptt.simulate(_some_rig(), DATA / "targets.csv", seed=1.5), "seed: 1.5 is not a whole"),
    ):
        with pytest.raises(PttError, match=words) as refused:
            call()
        assert refused.value.exit_code == 2
    assert str(ptt.compare(here / "machine.toml", str(here / "run.csv"))) == str(done["compare"])


@pytest.mark.parametrize("own", [0, 1])
def test_rows_that_were_read_for_another_machine_are_refused_in_words(here, tmp_path, own):
    machines = ptt.load(here / "machine.toml"), ptt.load(DATA / "arm" / "machine.toml")
    runs = ptt.read(here / "run.csv", machines[0]), ptt.read(DATA / "arm" / "run.csv", machines[1])
    model, run = machines[own], runs[1 - own]
    words = (
        r"the commands are q1_cmd_rad, q2.*, and the machine is a 3-PTT, whose sliders are b1 to b3",
        r"the commands are b1_cmd, b2_cmd, b3_cmd, and the machine is an arm, whose joints are q1 to q\d",
    )[own]
    for call in (
        lambda: ptt.check(model, run),
        lambda: ptt.compare(model, run),
        lambda: ptt.diagnose(model, run),
        lambda: ptt.add(model, run, "backlash"),
        lambda: ptt.fit(model, run),
        lambda: ptt.train(model, run),
        lambda: ptt.recheck(model, run),
        lambda: ptt.evaluate(model, run),
        lambda: ptt.evaluate(run, run, model=model),
        lambda: ptt.export(model, "urdf" if own else "table", tmp_path / "out", run=run),
    ):
        with pytest.raises(PttError, match=words) as refused:
            call()
        assert refused.value.exit_code == 2


def test_targets_alone_do_for_any_machine(here):
    model, place = ptt.load(here / "machine.toml"), [[0.0, 0.0, 0.0]]
    found = ptt.predict(model, ptt.read_targets(place, DATA / "arm" / "machine.toml"))
    np.testing.assert_array_equal(found.b, ptt.predict(model, place).b)
    assert list(found.to_frame().filter(regex="^[bq]1$")) == ["b1"]


def test_a_mechanism_takes_tensors_as_its_docstrings_say(here):
    mechanism, place = ptt.load(here / "machine.toml").mechanism, np.array([[0.0, 0.0, 0.0], [10.0, -20.0, 15.0]])
    q = mechanism.inverse(torch.as_tensor(place))
    np.testing.assert_allclose(mechanism.forward(q).numpy(), place, atol=1e-9)
    assert mechanism.jacobian(q).shape == (2, 3, 3)
    for verb in (mechanism.inverse, mechanism.forward, mechanism.jacobian, ptt.Model.mechanism):
        assert "float64" in (verb.__doc__ or "") and "tensor" in (verb.__doc__ or "")


def test_a_model_to_evaluate_may_be_named_by_the_path_of_its_file_or_folder(here, done):
    trained = str(ptt.evaluate(done["train"], here / "run.csv"))
    for kind in (str, Path):
        run, folder = kind(here / "run.csv"), kind(here / "compensator")
        assert str(ptt.evaluate(kind(here / "solved.toml"), run)) == str(done["evaluate"])
        assert str(ptt.evaluate(folder, run)) == trained
        for model in (kind(here / "solved.toml"), folder):
            with pytest.raises(PttError, match="exchange them"):
                ptt.evaluate(run, model)


def test_readings_are_never_written_over(here, done):
    with pytest.raises(InputError, match="holds readings"):
        done["predict"].to_csv(here / "run.csv")


def test_an_export_names_the_file_of_its_model_while_that_says_the_same(here, tmp_path):
    path = tmp_path / "kept.toml"
    text = (here / "machine.toml").read_text()
    path.write_text(
        text + '\n[[effect]]\nname = "backlash"\n[effect.parameters]\ngap_mm = { value = [0.1, 0.1, 0.1] }\n'
    )
    model = ptt.load(path)
    by_path, loaded = (ptt.export(each, "marlin", tmp_path / "m.txt").to_dict() for each in (path, model))
    assert by_path == loaded and by_path["model"] == str(path)
    path.write_text(text)
    assert ptt.export(model, "marlin", tmp_path / "m.txt").to_dict()["model"] == "model.toml"


@pytest.mark.usefixtures("told")
def test_progress_is_told_when_asked(here):
    heard: list[str] = []
    ptt.fit(here / "solved.toml", here / "run.csv", progress=lambda what, done, of: heard.append(what))
    assert heard
