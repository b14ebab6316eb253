"""A link of an arm that grows as it warms: told as that link's length, and written as a law of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ptt.diagnosis.diagnose import diagnose
from ptt.effects.bench import sample_machine
from ptt.effects.dh_offsets import links_along
from ptt.effects.prefilled import prefilled
from ptt.effects.registry import library, make_effect
from ptt.judge.ladder.climb import climb
from ptt.machine import MachineFile
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.serial import Serial
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.run.table import make_table

SIGMA = 0.01


def arm() -> MachineFile:
    file = sample_machine("serial")
    return replace(file, tracker=file.tracker.model_copy(update={"frame": "fitted", "sigma_mm": SIGMA}))


def longer(arm: Serial, link: int, strain: float) -> Serial:
    """The arm with one link longer by a share of its length."""
    a, d = list(arm.a_mm), list(arm.d_mm)
    a[link], d[link] = (1.0 + strain) * a[link], (1.0 + strain) * d[link]
    return replace(arm, a_mm=tuple(a), d_mm=tuple(d))


def test_a_link_grows_along_itself() -> None:
    file = arm()
    drawn = build_mechanism(file.machine)
    assert isinstance(drawn, Serial)
    q = torch.as_tensor(np.random.default_rng(3).uniform(-1.0, 1.0, (20, drawn.joints)))
    along = links_along(drawn)
    for link, (a, d) in enumerate(zip(drawn.a_mm, drawn.d_mm, strict=True)):
        length = float(np.hypot(a, d))
        there = longer(drawn, link, 1e-3).forward(q)
        torch.testing.assert_close(drawn.forward(q, 1e-3 * length * along[:, link]), there, atol=1e-9, rtol=0.0)


def test_links_are_the_same_bodies_in_both_conventions() -> None:
    """The arm of the modified convention has each common normal one row later, and so the same lengths grow."""
    drawn = build_mechanism(arm().machine)
    assert isinstance(drawn, Serial) and drawn.convention == "standard"
    zero = (0.0,)
    craig = replace(drawn, convention="modified", a_mm=zero + drawn.a_mm[:-1], alpha_rad=zero + drawn.alpha_rad[:-1])
    q = torch.as_tensor(np.random.default_rng(5).uniform(-1.0, 1.0, (10, drawn.joints)))
    for link in range(drawn.joints - 1):  # behind the last one the flange hangs on the tool's shift
        a, d = drawn.a_mm[link], drawn.d_mm[link]
        if not np.hypot(a, d):
            continue
        one = drawn.forward(q, links_along(drawn)[:, link]) - drawn.forward(q)
        two = craig.forward(q, links_along(craig)[:, link]) - craig.forward(q)
        turned = [each.square().sum(dim=1) for each in (one, two)]  # the flange's own frame is another
        torch.testing.assert_close(*turned, atol=1e-9, rtol=1e-6)


@pytest.mark.parametrize("link", [pytest.param(1, marks=pytest.mark.long), 2])
def test_a_link_that_warms_alone_is_told_and_written(tmp_path: Path, link: int) -> None:
    """The elbow's side of the arm is warmed by its motors; its zero lies at the drawing's temperature."""
    file, random, rows = arm(), np.random.default_rng(link), 220
    drawn = build_mechanism(file.machine)
    assert isinstance(drawn, Serial)
    q = random.uniform(-1.0, 1.0, (rows, drawn.joints))
    warmth = 8.0 * (1.0 - np.exp(-np.linspace(0.0, 3.0, rows)))
    length = float(np.hypot(drawn.a_mm[link], drawn.d_mm[link]))
    grown = 60e-6 * length * warmth  # twice what a motor's heat does to aluminium, so that 220 rows show it well
    error = grown[:, None] * links_along(drawn)[:, link].numpy()
    read = drawn.forward(torch.as_tensor(q), torch.as_tensor(error)).numpy()
    read += random.normal(0.0, SIGMA / np.sqrt(3.0), read.shape)
    table = make_table(
        None, q, read, time_s=8.0 * np.arange(rows), temp_c=20.0 + warmth + random.normal(0.0, 0.2, rows)
    )
    problem = build_problem(file, table)
    found = diagnose(Model(file), problem)
    first = found.depends_on[0]
    assert found.verdict == "unknown" and not found.suggested
    assert (first.acts_on, first.on) == (f"link {link + 1}", "temperature")
    assert f"as if link {link + 1} changed its length" in found.words
    path = tmp_path / "own.py"
    path.write_text(prefilled("own-cause", [first.to_dict()]).text)
    ladder = climb(Model(file), problem, [make_effect(library(path), "own-cause")])
    before, after = (step.heldout_rms_um["total"] for step in (ladder.steps[0], ladder.steps[-1]))
    assert after < 0.4 * before
