"""How far work has come, in words."""

from pathlib import Path

from ptt.machine import load_machine
from ptt.model.entries import read_model
from ptt.plan.first_run import plan_first_run
from ptt.progress import StagePace

DATA = Path(__file__).resolve().parents[1] / "data"


def test_rate_and_time_left_are_of_the_present_stage():
    now = [0.0]
    pace, told = StagePace(lambda: now[0]), []
    for done in range(0, 41, 10):
        told.append(pace.words(done, 100))
        now[0] += 5.0
    assert told[0] == "0 of 100" and told[-1] == "40 of 100, 2 a second, 30 s left"
    assert pace.stage == 1 and pace.words(0, 10) == "0 of 10" and pace.stage == 2
    now[0] += 60.0
    assert pace.words(3, 10) == "3 of 10, 3 a minute, 2 min left"
    assert pace.words(0, 0) == "" and pace.stage == 3


def test_a_plan_tells_how_far_it_is():
    told: list[tuple[str, int, int]] = []
    model = read_model(load_machine(DATA / "sealed_one" / "machine.toml"))
    plan_first_run(model, rows=150, progress=lambda what, done, of: told.append((what, done, of)))
    assert {what for what, _, _ in told} == {"poses", "what the rows will tell"}
    assert all(0 <= done < of for _, done, of in told)
