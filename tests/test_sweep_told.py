"""The sweep is run and reported: a case that breaks, shares, families, pictures."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import sweep
import sweep_pictures
import sweep_report

from ptt.challenge.cases import Case, plan
from ptt.challenge.truth import table_of
from ptt.errors import TableError
from ptt.rig import simulate
from ptt.rig.draw_foreign import draw_foreign


def test_a_case_that_breaks_is_a_result(monkeypatch, tmp_path: Path) -> None:
    def broken(*_args, **_keys):
        raise ZeroDivisionError("nothing left")

    monkeypatch.setattr(sweep, "diagnose", broken)
    rows = list(sweep.sweep(plan("single", 2, 0, rows=40), 1))
    assert [row["error"] for row in rows] == ["ZeroDivisionError: nothing left"] * 2
    assert "broken" in rows[0]["trace"]
    (tmp_path / "single.json").write_text(json.dumps(rows, default=sweep.plain))
    text = "\n".join(sweep_report.report(sweep_report.load(tmp_path)["single"]))
    assert "refused 0, broken 2" in text and "BROKEN ZeroDivisionError" in text

    def refused(*_args, **_keys):
        raise TableError("too few", fix="measure more rows")

    monkeypatch.setattr(sweep, "draw", refused)
    row = sweep.run_case(plan("none", 1, 0)[0])
    assert row["refused"] and "measure more rows" in row["error"] and sweep_report.judged([row]) == [row]
    assert "refused 1, broken 0" in sweep_report.summary("none", [row])


def test_a_whole_case() -> None:
    row = sweep.run_case(Case(1, "single", "volume", ("backlash",), "white", rows=90))
    assert "error" not in row, row
    assert row["verdict"] in ("missing", "nothing-missing", "unknown")
    assert row["rows"] >= 60 and row["seconds"] > 0.0 and set(row["hidden"]) == {"backlash"}
    assert json.loads(json.dumps(row, default=sweep.plain))["noise"] == "white"
    assert sweep_report.judged([row]) == [row]


def row(**changes) -> dict:
    usual = {
        "seed": 1, "level": "single", "protocol": "volume", "faults": ["backlash"], "noise": "white", "path": "cloud",
        "repeats": "none", "rows": 100, "hidden": {"backlash": 4.0}, "counted": ["backlash"], "outside": [],
        "verdict": "missing", "named": [["backlash"]], "words": {"backlash": "right"}, "outcome": "exact",
        "right": True, "seconds": 1.0, "statements": [[0.95, True]], "pulls": [["backlash gap_mm", 1.0]],
        "depends": [], "leading": None,
        "tool": {"before": 4.0, "after": 0.3, "worse": False, "rosy": 1.1},
    }  # fmt: skip
    return usual | changes


def test_shares_are_counted_by_hand() -> None:
    windup = {"words": {"windup": "wrong"}, "named": [["windup"]]}
    wrong = row(seed=2, noise="heavy", outcome="wrong", statements=[[0.92, False]], **windup)
    more = {"words": {"backlash": "right", "windup": "partial"}}
    extra = row(seed=3, outcome="extra", pulls=[["backlash gap_mm", -6.0]], **more)
    small = row(seed=4, counted=[], outcome="silent", words={}, named=[], statements=[], pulls=[], tool=None)
    rows = [row(), wrong, extra, small]
    line = sweep_report.summary("single", rows)
    assert "4 rigs, 3 judged: right 1/3 = 33 %" in line
    assert "wrong names 0.67" in line and "first 2/3" in line and "worse 0/3" in line
    text = "\n".join(sweep_report.report(rows, [row(noise="heavy")]))
    assert "statements of 90% and more: right 2/3" in text
    assert "3 pulls: within 2 sigma 66.7%; beyond 5: ['backlash gap_mm -6.0']" in text
    assert "heavy                   0/1" in text and "before 1/1" in text
    assert text.count("    seed ") == 2


def test_families_have_their_own_right() -> None:
    nothing = {"faults": [], "hidden": {}, "counted": [], "named": [], "words": {}, "tool": None}
    quiet = row(level="none", verdict="nothing-missing", **nothing)
    assert sweep_report.is_right(quiet | {"right": True}) and not sweep_report.is_right(quiet | {"right": False})
    odd = row(level="unknown", hidden={"hose": 5.0}, counted=["hose"], outside=["hose"], right=True, outcome="wrong")
    assert sweep_report.is_right(odd) and sweep_report.judged([odd]) == [odd]
    assert sweep_report.judged([odd | {"counted": []}]) == []
    assert not sweep_report.is_right(odd | {"error": "x"})
    quiet = odd | {"verdict": "nothing-missing", "named": [], "sigma_told": False, "std_told": False}
    told = quiet | {"sigma_told": True}
    line = sweep_report.summary("unknown", [quiet, told])
    assert "nothing-missing 2, noise stated in 1" in line


def test_pictures_are_drawn(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    chance = random.random(200)
    said = [(float(p), bool(random.random() < p)) for p in chance] + [(1.0, True)]
    sweep_pictures.draw_reliability(said, tmp_path / "r.png")
    windup = {"words": {"windup": "wrong"}, "named": [["windup"]], "outcome": "wrong"}
    rows = [row(), row(hidden={"backlash": 1.1}, counted=[], named=[], outcome="silent"), row(**windup)]
    sweep_pictures.draw_detection(rows, tmp_path / "d.png")
    sweep_pictures.draw_confusion(rows, tmp_path / "c.png")
    assert min((tmp_path / f"{name}.png").stat().st_size for name in "rdc") > 5000


def test_columns_nobody_wrote_down_are_not_there() -> None:
    drawn = draw_foreign(1, path="walk", rows=30, noise="white")
    rig = replace(drawn.rig, tracker=drawn.rig.tracker.model_copy(update={"report_std": True}))
    frame = simulate(rig, drawn.targets).frame
    bare, full = table_of(frame, ("payload_kg", "temp_c")), table_of(frame)
    assert bare.payload_kg is None and bare.temp_c is None and bare.time_s is not None
    assert full.payload_kg is not None
    np.testing.assert_array_equal(full.std, frame[["x_std", "y_std", "z_std"]].to_numpy())
