"""The report: its figures are those of the other verbs, its page needs nothing else, whatever the names in the data."""

import json
import re
from base64 import b64decode
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from made_runs import KNOWN, empty_run, machine, measure, term
from report_page import Page
from report_page import minimal as minimal

from ptt.correct.training.compensator import Compensator, load_compensator, save_compensator
from ptt.correct.training.train import train
from ptt.diagnosis.search.rest import LIGHT_NETWORK
from ptt.errors import InputError, ModelError
from ptt.files import sha256
from ptt.judge.history import record
from ptt.judge.ladder.climb import climb
from ptt.machine import save_machine
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table
from ptt.run.viewing import build_view
from ptt.run.written import write_table
from ptt.show.report import interactive
from ptt.show.report.contents import Contents
from ptt.show.report.gather import with_network
from ptt.show.report.html import render
from ptt.show.report.numbers import plus_minus
from ptt.show.report.source import source_of


def spoken(*args: object) -> dict:
    outcome = invoke(*args, "--json")
    assert outcome.exit_code == 0, outcome.stderr
    return json.loads(outcome.stdout)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with backlash, its repeats, the drawing, a fitted model with history, and a compensator."""
    place = tmp_path_factory.mktemp("report")
    file, table = machine(), empty_run(60)
    target = np.tile(table.target, (2, 1))
    columns = {key: np.tile(getattr(table, key), 2) for key in ("payload_kg", "temp_c", "feed_mm_s")}
    table = make_table(target, time_s=10.0 * np.arange(120), **columns)
    table = measure(table, file, [term("backlash", build_view(file, table), [0.03, 0.05, 0.02])])
    write_table(table, place / "run.csv")
    later = measure(table, file, [term("backlash", build_view(file, table), [0.03, 0.01, 0.02])])  # slider 2 is mended
    write_table(later, place / "after.csv")
    save_machine(file, place / "drawing.toml")
    problem = build_problem(file, table)
    ladder = climb(Model(file), problem, [KNOWN["backlash"]()])
    save_machine(record(ladder, "add", [place / "run.csv"]), place / "model.toml")
    save_compensator(place / "comp", train(ladder.model, problem, settings=LIGHT_NETWORK), [str(place / "run.csv")])
    return place


@pytest.fixture(scope="module")
def told(folder: Path) -> tuple[dict, str]:
    """The report as JSON and as HTML."""
    out = folder / "out" / "report.html"
    data = spoken(
        "report",
        folder / "run.csv",
        "--model",
        folder / "model.toml",
        "--compensator",
        folder / "comp",
        "--after",
        folder / "after.csv",
        "--out",
        out,
    )
    return data, out.read_text(encoding="utf-8")


def test_a_later_run_stands_beside_the_first(folder: Path, told: tuple[dict, str]) -> None:
    files = folder / "run.csv", "--after", folder / "after.csv", "--model", folder / "model.toml"
    pair = told[0]["before_after"]
    figures = ("rms_um", "max_um", "rows")
    beside = spoken("compare", *files)["before_after"]
    assert [pair[side][key] for side in ("before", "after") for key in figures] == [
        beside[side][key] for side in ("before", "after") for key in figures
    ]
    assert [pair[key] for key in ("where", "reduction_percent")] == [beside["where"], beside["reduction_percent"]]
    assert pair["after"]["rms_um"]["total"] < pair["before"]["rms_um"]["total"]  # of a gap that was halved and more
    page = Page(told[1])
    assert "The run beside a later one" in page.text and "Before: run.csv; after: after.csv" in page.text
    assert f"{pair['nearer_share']:.0%} of {pair['shared_poses']} readings at poses" in page.text
    assert any("--after after.csv" in line for line in told[0]["commands"])


def test_figures_are_those_of_the_other_verbs(folder: Path, told: tuple[dict, str]) -> None:
    data, run, model = told[0], folder / "run.csv", folder / "model.toml"
    names = {"source", "network_left_aside", "setup"}  # a report is not written over a mistaken set-up
    for name, file in (("drawing", folder / "drawing.toml"), ("model", model)):
        compared = spoken("compare", run, "--model", file)
        assert {key: data["compare"][name][key] for key in compared if key not in names} == {
            key: value for key, value in compared.items() if key not in names
        }
        assert data["diagnose"][name] == spoken("diagnose", run, "--model", file)
    assert data["fit"] == spoken("fit", run, "--model", model)
    reduced = spoken("evaluate", run, "--model", folder / "comp")["protocols"]
    for name in ("blocks", "random"):
        for axis, figures in reduced[name]["axes"].items():
            assert data["evaluate"][name]["axes"][axis] == pytest.approx(figures, rel=1e-6)


def test_figures_of_the_standard_are_those_of_its_verb(folder: Path, told: tuple[dict, str]) -> None:
    said = spoken("iso", folder / "run.csv", "--model", folder / "model.toml") if told[0]["iso"] else None
    if said is None:
        outcome = invoke("iso", folder / "run.csv", "--model", folder / "model.toml")
        assert outcome.exit_code == 3 and told[0]["why_not"]["iso"] in outcome.stderr
    else:
        assert {**said, "source": "run.csv"} == told[0]["iso"]


def test_the_numbers_stand_in_the_page(told: tuple[dict, str]) -> None:
    data, page = told[0], Page(told[1])
    assert data["diagnose"]["drawing"]["suggested"][0][0] == "backlash"
    figures = data["compare"]["drawing"]["rms_um"]
    row = " ".join(f"{figures[axis]:.1f}" for axis in ("x", "y", "z", "total"))
    assert f"after frame alignment: RMS {row}" in page.text
    for axis, values in data["evaluate"]["blocks"]["axes"].items():
        assert (
            f"{axis} {values['before_um']:.1f} {values['after_um']:.1f} {values['reduction_percent']:.1f} %"
            in page.text
        )
    for value in data["fit"]["parameters"]:
        assert f"{value['name']} mm" in page.text and plus_minus(value["value"], value["std"]) in page.text
    assert f"noise floor, from {data['compare']['model']['noise_um']['source']}" in page.text
    assert data["history"][0][0]["effect"] == "backlash" and "+ backlash" in page.text
    assert "ptt add run.csv backlash --model BEFORE.toml --out AFTER.toml" in page.text


def test_page_is_whole_and_needs_nothing_else(told: tuple[dict, str]) -> None:
    page = Page(told[1])
    assert page.faults == []
    assert page.addresses and all(one.startswith(("#", "data:image/png;base64,")) for one in page.addresses)
    assert "script" not in page.tags and "link" not in page.tags
    assert re.search(r"url\s*\(|@import|https?:", told[1]) is None
    assert page.tags.count("img") == len([one for one in page.addresses if one.startswith("data:")]) >= 5


def test_nothing_of_the_computer_is_told(folder: Path, told: tuple[dict, str]) -> None:
    page = Page(told[1])
    assert str(folder) not in told[1] and folder.name not in told[1]
    assert str(folder) not in json.dumps({key: value for key, value in told[0].items() if key != "out"})
    for name in ("run.csv", "model.toml", "comp/rbf.safetensors"):
        assert f"{name} {sha256(folder / name)}" in page.text
    whole = "ptt report run.csv --model model.toml --after after.csv --compensator comp --out report.html"
    assert whole in page.text


def test_commands_that_are_printed_run_and_give_the_same(
    folder: Path, told: tuple[dict, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    lines = {line.split()[1]: line.split()[1:] for line in told[0]["commands"]}
    assert set(lines) == {"remove", "compare", "diagnose", "fit", "evaluate", "iso", "report"}
    assert invoke(*lines["remove"]).exit_code == 0
    assert spoken("compare", "run.csv", "--model", "drawing.toml")["rms_um"] == told[0]["compare"]["drawing"]["rms_um"]


def test_without_plotly_the_extra_is_named(folder: Path, minimal: Contents, monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(interactive.importlib, "import_module", gone)
    with pytest.raises(InputError, match=r"plotly is not installed; install it with: pip install 'ptt\[studio\]'"):
        render(minimal, interactive=True)


@pytest.mark.parametrize("broken", ["run", "model", "column", "folder"])
def test_bad_input_is_one_line_and_leaves_no_file(
    folder: Path, minimal: Contents, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, broken: str
) -> None:
    out, run, model = tmp_path / "report.html", folder / "run.csv", folder / "model.toml"
    if broken == "folder":
        out = tmp_path / "file" / "report.html"
        (tmp_path / "file").write_text("in the way")
        monkeypatch.setattr("ptt.show.report.of_run.gather", lambda *given, **options: minimal)
    if broken == "column":
        run = tmp_path / "bad.csv"
        run.write_text("x_cmd,y_cmd,z_cmd,x_meas,y_meas,z_meas\n1,2,3,1,2,--\n")
    if broken == "run":
        run = tmp_path / "none.csv"
    if broken == "model":
        model = tmp_path / "none.toml"
    outcome = invoke("report", run, "--model", model, "--out", out)
    assert outcome.exit_code == 2 and outcome.stdout == ""
    assert len(outcome.stderr.splitlines()) == 1 and outcome.stderr.startswith("error: ")
    assert not out.exists() and not list(tmp_path.glob("**/.report*"))


def test_network_of_another_model_is_refused(folder: Path) -> None:
    bare, trained = load_compensator(folder / "drawing.toml"), load_compensator(folder / "comp")
    with pytest.raises(ModelError, match=r"trained on another model \(backlash\) than the one given \(no effects\)"):
        with_network(bare, trained, "comp")
    with pytest.raises(ModelError, match="no network in it"):
        with_network(trained, Compensator(trained.model, None, {}), "comp")
    assert with_network(load_compensator(folder / "model.toml"), trained, "comp").network is trained.network


def test_options_return_in_the_commands(folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "second run.csv"
    other.write_bytes((folder / "run.csv").read_bytes())
    paths = {"run": [folder / "run.csv"], "also": [other], "model": [folder / "model.toml"]}
    source = source_of(paths, ["payload_kg=2"])
    assert source.clean(f"{other}: 120 rows") == "second run.csv: 120 rows"
    from ptt.show.report.commands import commands_of

    last = commands_of(source, load_compensator(folder / "model.toml").model, network=False)[-1].line
    assert last == (
        "ptt report run.csv --model model.toml --also 'second run.csv' --set payload_kg=2 --out report.html"
    )


def test_the_card_and_the_machine_stand_on_top(told: tuple[dict, str]) -> None:
    data, html = told
    top = html[html.index('id="card"') : html.index("<nav")]
    page = Page(f"<section {top}")
    assert "One cause found" in page.text and "on reversal: backlash." in page.text and page.tags.count("img") == 1
    first = data["diagnose"]["drawing"]["candidates"][0]
    largest = max(abs(value["value"]) for value in first["parameters"])
    assert f"{1e3 * largest:.0f} \N{MICRO SIGN}m" in page.text  # the size of what was found, in the page's unit
    assert "pc-bar" in top and "To set right" in page.text


def test_every_picture_is_whole_and_every_length_in_the_page_s_unit(told: tuple[dict, str]) -> None:
    """Signs of a picture may look like a unit; they are none."""
    _, html = told
    pictures = re.findall(r'src="data:image/png;base64,([^"]*)"', html)
    assert len(pictures) > 3
    assert all(b64decode(each, validate=True).startswith(b"\x89PNG") for each in pictures)
    words = re.sub(r'"data:[^"]*"', "", html)
    assert "\N{MICRO SIGN}m" in words and not re.search(r"(?<![\w-])um(?![\w-])", words)


def test_every_table_has_heads_and_scrolls_by_itself(told: tuple[dict, str]) -> None:
    html = told[1]
    assert re.search(r"<th[^>]*>\s*</th>", html) is None
    assert html.count('<div class="wide"') == html.count("<table") > 5
    assert ".wide { overflow-x: auto" in html
