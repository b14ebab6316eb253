"""A machine file that nothing can be built of, because of a diameter given for a radius, is checked all the same."""

import json
from pathlib import Path

import pytest
from test_commands_main import invoke

from ptt.machine import load_machine, parse_machine

DATA = Path(__file__).parent.parent / "data" / "sealed_one"


def test_a_diameter_for_a_radius_is_found_though_no_machine_can_be_built_of_it(tmp_path: Path) -> None:
    text = (DATA / "machine.toml").read_text()
    drawn, cured = tmp_path / "drawn.toml", tmp_path / "cured.toml"
    drawn.write_text(text.replace("base_radius_mm = 200.0", "base_radius_mm = 400.0  # of the base"))
    told = invoke("check", DATA / "run.csv", "--model", drawn, "--out-model", cured, "--json")
    assert told.exit_code == 0, told.stderr
    data = json.loads(told.stdout)
    assert [(item["mistake"], item["sure"]) for item in data["findings"]] == [("diameter-for-radius", True)]
    assert data["findings"][0]["fix"] == "write base_radius_mm = 200" and not data["ok"]
    assert load_machine(cured).machine == parse_machine(text).machine and "# of the base" in cured.read_text()
    for verb in ("compare", "diagnose"):
        refused = invoke(verb, DATA / "run.csv", "--model", drawn, "--json")
        assert refused.exit_code == 2 and "is a diameter given for a radius?" in refused.stderr


@pytest.mark.parametrize(
    "change", [("link_length_mm = 300.0", "link_length_mm = 40.0"), ("base_radius_mm = 200.0", "")]
)
def test_a_machine_file_that_no_half_radius_cures_is_refused_as_ever(tmp_path: Path, change: tuple[str, str]) -> None:
    drawn = tmp_path / "drawn.toml"
    drawn.write_text((DATA / "machine.toml").read_text().replace(*change))
    refused = invoke("check", DATA / "run.csv", "--model", drawn, "--json")
    assert refused.exit_code == 2 and not refused.stdout


@pytest.mark.parametrize("damage", ["a." * 3000 + "b = 1", "kind = " + "[" * 3000 + "]" * 3000], ids=["keys", "lists"])
def test_a_machine_file_of_a_thousand_levels_is_refused_in_one_line(tmp_path: Path, damage: str) -> None:
    machine = tmp_path / "machine.toml"
    machine.write_text(damage + "\n" + (DATA / "machine.toml").read_text())
    refused = invoke("check", DATA / "run.csv", "--model", machine, "--json")
    assert refused.exit_code == 2 and "levels" in refused.stderr and len(refused.stderr.splitlines()) == 1
