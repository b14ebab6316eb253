"""What hangs on an arm's last link and gives way to gravity: told in the tool's own frame, written, and taken out."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from serial_arms import MACHINES, close, preset, some_joints
from test_report_chinese import SAY, latin

from ptt.dependence.dependence import Dependence
from ptt.diagnosis.diagnose import Diagnosis, diagnose
from ptt.diagnosis.telling.depends import _between
from ptt.diagnosis.telling.next_look import next_look
from ptt.diagnosis.telling.verdict_words import depends
from ptt.door.diagnosing import _next
from ptt.effects import Curve, library
from ptt.effects.bench import sample_view
from ptt.effects.case import make_case
from ptt.effects.contract import check_acts
from ptt.effects.curve_basis import GRAVITY
from ptt.effects.own import load_effects
from ptt.effects.prefilled import prefilled
from ptt.fitting.solve import fit
from ptt.machine import load_machine
from ptt.mechanisms import build_mechanism
from ptt.mechanisms.serial import Serial
from ptt.model.chain import differentiate
from ptt.model.model import Model
from ptt.run.problem import Problem, build_problem
from ptt.run.table import make_table

SIGMA = 0.03  # mm


def hung(name: str, shift: np.ndarray | None = None, bend: float = 0.0, *, load: bool = False) -> Problem:
    """An arm whose tool falls to the lower side along its own axes by `shift` mm, or bends by `bend` mm (each kg)."""
    file, random = load_machine(MACHINES / f"{name}.toml"), np.random.default_rng(11)
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": SIGMA, "frame": "fitted"}))
    robot = build_mechanism(file.machine)
    assert isinstance(robot, Serial)
    sent = random.uniform(-1.9, 1.9, (180, robot.joints))
    place, turn = (part.numpy() for part in robot.pose(torch.as_tensor(sent)))
    pull = np.einsum("nca,c->na", turn, np.array([0.0, 0.0, -1.0]))
    payload = random.choice([0.0, 3.0, 6.0], len(sent)) if load else np.ones(len(sent))
    own = bend * payload[:, None] * pull * [1.0, 1.0, 0.2] if shift is None else shift * np.sign(pull)
    context = {"payload_kg": payload} if load else {}
    reached = place + np.einsum("nca,na->nc", turn, own)
    return build_problem(file, make_table(None, sent, reached + random.normal(0.0, SIGMA, place.shape), **context))


def aside(offset: np.ndarray) -> Problem:
    """An arm whose joints yield to the slope of the load's potential energy, its centre `offset` m from the tool."""
    file, random = load_machine(MACHINES / "kuka_iiwa.toml"), np.random.default_rng(5)
    file = replace(file, tracker=file.tracker.model_copy(update={"sigma_mm": SIGMA, "frame": "fitted"}))
    robot = build_mechanism(file.machine)
    assert isinstance(robot, Serial)
    sent = torch.as_tensor(random.uniform(-1.6, 1.6, (200, robot.joints))).requires_grad_()
    load = random.choice([0.0, 4.0, 8.0], len(sent))
    place, turn = robot.pose(sent)
    height = 1e-3 * place[:, 2] + turn[:, 2] @ torch.as_tensor(offset)
    slope = torch.autograd.grad((torch.as_tensor(load) * 9.80665 * height).sum(), sent)[0].numpy()
    yields = 1e-6 * np.array([0.0, 9.0, 9.0, 13.0, 25.0, 38.0, 0.0])
    reached = robot.forward(torch.as_tensor(sent.detach().numpy() - yields * slope)).numpy()
    reading = reached + random.normal(0.0, SIGMA, reached.shape)
    return build_problem(file, make_table(None, sent.detach().numpy(), reading, payload_kg=load))


@pytest.fixture(scope="module")
def fallen() -> tuple[Problem, Diagnosis]:
    problem = hung("ur10", np.array([0.3, 0.15, 0.0]))
    return problem, diagnose(Model(problem.file), problem)


def test_a_tool_that_falls_to_the_lower_side_is_told_along_its_own_axes(fallen):
    found = fallen[1]
    assert (found.verdict, found.suggested) == ("unknown", ())
    first, second = found.depends_on[:2]
    assert [(one.residual, one.on, one.shape, one.acts_on) for one in (first, second)] == [
        ("x", "gravity x", "step", "mount"),
        ("y", "gravity y", "step", "mount"),
    ]
    assert first.share + second.share > 0.95
    for one, size in ((first, 0.6), (second, 0.3)):
        assert one.size is not None and one.size.value == pytest.approx(size, abs=0.06)
    assert "further toward +x of its own frame above gravity x =" in found.words


def test_the_effects_that_are_written_for_it_take_it_out(fallen, tmp_path):
    problem, found = fallen
    written = prefilled("loose-tool", found.to_dict()["depends_on"][:2])
    (tmp_path / "loose.py").write_text(written.text)
    known = load_effects(tmp_path / "loose.py")
    assert "What of the tool's own x follows gravity x" in written.text
    for name in written.names:
        assert check_acts(make_case(known[name](), "serial", differentiate)) == ""
    model = Model(problem.file)
    for name in written.names:
        model = model + known[name]()
    left = fit(model, problem).residual
    assert float(np.sqrt(np.nanmean(np.square(left).sum(axis=1)))) < 1.1 * np.sqrt(3.0) * SIGMA


def test_a_tool_that_bends_under_its_load_is_told_and_taken_out(tmp_path):
    problem = hung("ur10", bend=0.08, load=True)
    found = diagnose(Model(problem.file), problem)
    assert (found.verdict, found.suggested) == ("unknown", ())
    first = found.depends_on[0]
    assert (first.together, first.acts_on) == (("payload", "gravity x", "gravity y", "gravity z"), "mount")
    assert first.share > 0.9
    said = depends(first)
    assert "payload and how gravity lies in the tool's own frame (gravity x to gravity z) together" in said
    assert "重力在工具自身坐标系中的方向" in SAY(said)
    (tmp_path / "sag.py").write_text(prefilled("sag", found.to_dict()["depends_on"][:1]).text)
    left = fit(Model(problem.file) + load_effects(tmp_path / "sag.py")["sag"](), problem).residual
    assert float(np.sqrt(np.nanmean(np.square(left).sum(axis=1)))) < 1.1 * np.sqrt(3.0) * SIGMA


def test_a_tool_that_bends_is_no_joint_that_sags():
    problem = hung("ur10", bend=0.4)
    found = diagnose(Model(problem.file), problem)
    assert found.verdict == "unknown" and "self-weight" not in {name for step in found.suggested for name in step}
    assert found.depends_on[0].on.startswith("gravity") and found.depends_on[0].acts_on == "mount"


class Falling(Curve):
    name = "falling"
    mechanisms = ("serial",)
    on, shape, between, acts_on = "gravity z", "step", (-0.1, 0.1), "mount"


def test_a_curve_moves_the_mount_along_each_axis_of_the_tool_by_its_pull():
    robot = preset("ur10")
    view = replace(sample_view("serial", 6), mechanism=robot)
    view = replace(view, q=some_joints(robot, view.rows))
    basis = Falling().basis(view, {})
    pull = -robot.pose(view.q)[1][:, 2, 2]
    assert basis.shape == (view.rows, len(robot.slots), 3)
    close(basis[:, -3:], torch.eye(3) * (pull > 0.0).double()[:, None, None], 0.0)
    assert not basis[:, :-3].any()


def test_a_load_beside_the_tool_point_is_no_sag_under_the_arm_s_own_weight(tmp_path):
    problem = aside(np.array([0.12, 0.0, 0.18]))
    found = diagnose(Model(problem.file), problem)
    assert (found.verdict, found.suggested) == ("unknown", (("axis-compliance",),))
    first = found.depends_on[0]
    assert (first.on, first.acts_on) == ("payload", "load") and "beside the tool point" in found.words
    assert "beside the tool point" not in SAY(depends(first))
    (tmp_path / "aside.py").write_text(prefilled("aside", found.to_dict()["depends_on"][:1]).text)
    own = load_effects(tmp_path / "aside.py")["aside"]()
    assert check_acts(make_case(own, "serial", differentiate)) == ""
    left = fit(Model(problem.file) + library()["axis-compliance"]() + own, problem).residual
    assert float(np.sqrt(np.nanmean(np.square(left).sum(axis=1)))) < 1.1 * np.sqrt(3.0) * SIGMA


def test_a_jump_lies_between_known_values():
    """A column of one's own may lack some."""
    assert _between(np.array([3.0, np.nan, 1.0, 7.0]), 4.0) == (3.0, 7.0)


@pytest.mark.parametrize(
    ("on", "together", "written"),
    [("gravity x", (), True), ("payload", ("payload", *GRAVITY), True), ("payload", (), False), ("time", (), False)],
)
def test_a_diagnosis_says_that_an_effect_can_be_written_where_it_can(on, together, written):
    curve = np.zeros((1, 3))
    told = Dependence("x", on, 0.9, 0.0, None, "smooth", curve, acts_on="mount", together=together)
    lines = _next(SimpleNamespace(to_add=(), verdict="unknown", depends_on=(told,)), None)
    assert any("ptt effects new NAME --like D.json" in line for line in lines) is written
    assert not any(set(latin(SAY(line))) - {"gravity"} for line in next_look([told], untold=False))


def test_what_is_said_of_what_hangs(fallen):
    first = fallen[1].depends_on[0]
    said = [depends(first), *next_look([first], untold=False)]
    assert said[1:] == [
        "Look for the cause in the tool's holder.",
        "More poses that turn the tool against gravity would show it better.",
    ]
    assert [latin(SAY(line)) for line in said[1:]] == [[], []]
    assert SAY(said[0]).startswith("x 方向的剩余误差在重力在工具自身坐标系中的 x 分量（gravity x）越过")
