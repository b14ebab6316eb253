"""Nothing lost, nobody in: damaged inputs, kills, and the same result however the input is written."""

import os
import random
import subprocess
import sys
from pathlib import Path

import fuzz
import kill
import pytest
from fuzz_mutation import Mutation

CASES = 16


@pytest.fixture(scope="module")
def fuzzer(tmp_path_factory):
    fuzz.load_commands()
    return fuzz.Fuzzer(tmp_path_factory.mktemp("fuzz") / "fuzz", fleet=False)


def test_damaged_inputs_end_with_a_result_or_one_clear_line(fuzzer):
    outcomes = [fuzzer.case(number, seed=5) for number in range(CASES)]
    assert [(each.words, each.mutation, each.why) for each in outcomes if each.kind in fuzz.BAD] == []
    assert {"ok", "refused"} <= {each.kind for each in outcomes}


def test_the_judge_sees_what_is_broken(fuzzer, monkeypatch):
    """A fuzzer that finds nothing has to be able to find something."""
    words = ["compare", "run.csv", "--model", "model.toml", "--json"]
    for bad, kind in (
        (lambda _: 1 / 0, "internal"),
        (lambda _: Path("machine.toml").write_text("gone") and 0, "broken"),
        (lambda _: Path(".out.toml.tmp").write_text("half") and 0, "broken"),
        (lambda _: print("NaN") or 0, "broken"),
        (lambda _: 2, "unclear"),
    ):
        fuzzer.fresh()
        monkeypatch.setattr(fuzz, "run_words", bad)
        before = fuzz.digests(fuzzer.place)
        ended = fuzz.fork_words(words, fuzzer.place, fuzzer.logs)
        assert fuzz.judge(ended, Mutation(""), words, "", before, fuzzer.place, None)[0] == kind


def test_json_is_the_same_however_columns_stand_and_threads_run(tmp_path):
    """A run large enough for numpy's linear algebra to share its sums out between threads, if it were let."""
    data = Path(__file__).resolve().parents[1] / "data" / "sealed_three"
    printed = []
    for threads in ("1", "2"):
        place = tmp_path / threads
        place.mkdir()
        (place / "machine.toml").write_text((data / "machine.toml").read_text())
        rows = [line.split(",") for line in (data / "run.csv").read_text().splitlines()]
        order = list(range(len(rows[0])))
        if threads == "2":
            random.Random(0).shuffle(order)
        (place / "run.csv").write_text("".join(",".join(row[i] for i in order) + "\n" for row in rows))
        environment = {**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
        words = ["add", "run.csv", "backlash", "--model", "machine.toml", "--out", "out.toml", "--json"]
        command = [sys.executable, "-m", "ptt", *words]
        done = subprocess.run(command, cwd=place, env=environment, capture_output=True, check=True)
        printed.append(done.stdout)
    assert len(printed[0]) > 500 and printed[0] == printed[1]


def test_a_killed_verb_leaves_the_old_or_the_new(fuzzer, tmp_path):
    found = kill.sweep(tmp_path / "kill", 4, 1, ["predict"], tell=False, base=fuzzer.base)
    assert [each for each in found if each.found != "whole"] == []
