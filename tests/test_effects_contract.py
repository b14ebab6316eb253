"""The contract suite over every effect, the contract over effects that break it, the cards, and `ptt effects`."""

import json

import numpy as np
import pytest
import torch
import typer
from typer.testing import CliRunner

from ptt.commands.effects import effects as verb
from ptt.effects import Effect, Parameter, library
from ptt.effects.bench import sample_view
from ptt.effects.card import RESIDUALS, Card
from ptt.effects.cards import card_of
from ptt.effects.case import make_case
from ptt.effects.contract import CHECKS, check_effect
from ptt.effects.curve import Curve
from ptt.effects.own import try_laws
from ptt.effects.phrases import Phrase
from ptt.effects.prefilled import prefilled
from ptt.effects.template import template
from ptt.errors import InputError, ModelError
from ptt.model.chain import differentiate
from ptt.show.plots.atlas import effect_signature, picture_theta
from ptt.show.plots.effects import plot_effect
from ptt.show.telling import VARIABLES

pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")

PULL = Parameter("pull", "mm", 0.1, "how far", count=3)


@pytest.mark.parametrize("name", library())
def test_effect_keeps_the_contract(name):
    effect = library()[name]()
    findings = check_effect(effect, differentiate)
    assert len(findings) == len(effect.mechanisms) * (1 + len(CHECKS))
    assert [finding for finding in findings if not finding.passed] == []


class Good(Effect):
    """Pulls sideways."""

    name = "good"
    stage = "structure"
    mechanisms = ("three-ptt",)
    parameters = (PULL,)

    def basis(self, view, shape):
        return torch.eye(3, dtype=torch.float64) * view.p[:, :1, None] / 100.0


class NoUnit(Good):
    parameters = (Parameter("pull", "um", 0.1, "how far", count=3),)


class NoMeaning(Good):
    parameters = (Parameter("pull", "mm", 0.1, " ", count=3),)


class NoSize(Good):
    parameters = (Parameter("pull", "mm", 0.0, "how far", count=3),)


class WrongShape(Good):
    def basis(self, view, shape):
        return torch.ones(view.rows, 2, 3, dtype=torch.float64)


class NotFinite(Good):
    def basis(self, view, shape):
        return super().basis(view, shape) / (view.payload > 0.0)[:, None, None]


class SinglePrecision(Good):
    def basis(self, view, shape):
        return super().basis(view, shape).float()


class NeverNominal(Good):
    def shift(self, theta, view):
        return super().shift(theta, view) + 1e-9


class Idle(Good):
    def basis(self, view, shape):
        return 0.0 * super().basis(view, shape)


class MixesRows(Good):
    def basis(self, view, shape):
        return super().basis(view, shape) - super().basis(view, shape).mean(dim=0)


class CutGradient(Good):
    def shift(self, theta, view):
        return super().shift(theta.detach() * theta[0] / theta[0].detach().clamp(min=1e-30), view)


class OtherBasis(Good):
    def shift(self, theta, view):
        return super().shift(1.1 * theta, view)


class CutInput(Good):
    def basis(self, view, shape):
        return torch.eye(3, dtype=torch.float64) * view.p.detach()[:, :1, None] / 100.0


class WritesView(Good):
    def basis(self, view, shape):
        view.payload.mul_(1.0 + 1e-12).add_(1e-12)
        return super().basis(view, shape)


class Refuses(Good):
    def needs(self, view):
        return "the moon"


class TakesAnything(Good):
    requires = ("payload",)

    def needs(self, view):
        return None


class Raises(Good):
    def basis(self, view, shape):
        raise RuntimeError("not today")


class SaysNothingOfTheSign(Good):
    phrases = (Phrase("pull", "pulls {what}", "pulls {what}", "the hose"),)


class SaysAnotherName(Good):
    phrases = (Phrase("push", "pulls {what} toward +{axis}", "pulls {what} toward -{axis}", "the hose"),)


class SaysTheSide(Good):
    phrases = (Phrase("pull", "pulls {what} toward +{axis}", "pulls {what} toward -{axis}", "the hose"),)


class SumsOtherwise(Good):
    def differentiable_shift(self, theta, view):
        return 1.01 * self.shift(theta, view)


BROKEN = [
    (SumsOtherwise, "derivative by input"),
    (SaysNothingOfTheSign, "words have a side"),
    (SaysAnotherName, "units stated"),
    (NoUnit, "units stated"),
    (NoMeaning, "units stated"),
    (NoSize, "units stated"),
    (WrongShape, "shapes and numbers"),
    (NotFinite, "shapes and numbers"),
    (SinglePrecision, "shapes and numbers"),
    (NeverNominal, "zero is nominal"),
    (Idle, "amplitudes act"),
    (MixesRows, "batch equals loop"),
    (CutGradient, "derivative by parameters"),
    (OtherBasis, "basis is the small limit"),
    (CutInput, "derivative by input"),
    (WritesView, "nothing is changed"),
    (Refuses, "needs of the data"),
    (TakesAnything, "needs of the data"),
    (Raises, "shapes and numbers"),
]


@pytest.mark.parametrize(("cls", "check"), BROKEN)
def test_contract_catches_a_broken_effect(cls, check):
    before = sample_view("three-ptt").payload.clone()
    broken = [finding.check for finding in check_effect(cls(), differentiate) if not finding.passed]
    sample_view("three-ptt").payload.copy_(before)
    assert check in broken


def test_contract_passes_a_good_effect():
    assert all(finding.passed for finding in check_effect(Good(), differentiate))
    assert all(finding.passed for finding in check_effect(SaysTheSide(), differentiate))


class OfTheWrist(Effect):
    """Joint 6 runs ahead with joint 5: coupled gears."""

    name = "of-the-wrist"
    stage = "drive"
    mechanisms = ("serial",)
    least_joints = 6
    parameters = (Parameter("share", "1", 1e-3, "share of joint 5's turn"),)

    def basis(self, view, shape):
        return torch.nn.functional.pad(view.q[:, 4, None, None], (0, 0, 5, view.joints - 6))


class OfOneJoint(Curve):
    name = "of-one-joint"
    mechanisms = ("serial",)
    on, acts_on, between = "q4", "joint 5", (-1.0, 1.0)


class OfOneLink(Curve):
    name = "of-one-link"
    mechanisms = ("serial",)
    on, acts_on, between = "direction7", "link 2", (-1.0, 1.0)
    shape = "levels"


@pytest.mark.parametrize(("cls", "joints"), [(OfTheWrist, 6), (OfOneJoint, 5), (OfOneLink, 7)])
def test_an_effect_of_the_wrist_is_tried_on_an_arm_that_has_one(cls, joints):
    """Most arms have six or seven joints, and their wrists err too."""
    assert cls.least_joints == joints and make_case(cls(), "serial", differentiate).view.joints == joints
    try_laws(cls, "own.py")
    assert [finding for finding in check_effect(cls(), differentiate) if not finding.passed] == []


def test_an_own_effect_of_a_wrist_is_written_and_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr("ptt.show.plots.atlas.GRID", 31)
    curve = {"at": [-1.5, 0.0, 1.5], "mean_um": [0.0, 1.0, 2.0], "half_width_um": [1.0, 1.0, 1.0]}
    cause = {"residual": "joint 5", "on": "q4", "acts_on": "joint 5", "shape": "smooth", "curve": curve}
    (tmp_path / "own.py").write_text(prefilled("own-cause", [cause]).text)
    effect = library(tmp_path / "own.py")["own-cause"]()
    view, theta = sample_view("serial", 5), picture_theta(effect, "serial")
    sign = effect_signature(effect, theta, view, card_of(effect))
    assert sign.labels[:2] == ("angle of joint 4 [rad]", "J e of joint 5 [urad]")
    np.testing.assert_allclose(sign.residual, 1e6 * effect.shift(theta, view)[:, 4].numpy(), rtol=1e-2, atol=1e-2)
    plot_effect(effect, tmp_path / "own.png")
    assert (tmp_path / "own.png").stat().st_size > 10_000


@pytest.mark.parametrize("name", library())
def test_every_effect_has_a_whole_card(name):
    card = card_of(library()[name])
    for text in (card.cause, card.equation, card.source, card.size, card.fingerprint, card.remedy, card.needs):
        assert text
    assert card.residual in RESIDUALS
    assert card.telling in VARIABLES
    assert card.shade in ("", *VARIABLES)
    assert len(card.confused_with) >= 2
    assert all(len(pair) == 2 and all(pair) for pair in card.confused_with)
    assert name not in [what for what, _ in card.confused_with]
    assert (card.needs != "-") or not library()[name].requires


@pytest.mark.parametrize("name", library())
def test_every_effect_of_the_library_can_be_said(name):
    effect = library()[name]()
    kind = effect.mechanisms[0]
    case = make_case(effect, kind, differentiate)
    assert effect.say(case.theta, torch.full_like(case.theta, torch.nan), case.view)
    assert effect.called and effect.cause(case.theta, case.view)


def test_own_card_or_docstring():
    own = Card("c", "e", "s", "z", "f", (), "r")
    assert card_of(type("Carded", (Good,), {"card": own})()) is own
    assert card_of(Good()).cause == "Pulls sideways."


def run(*words):
    app = typer.Typer()
    app.command()(verb)
    return CliRunner().invoke(app, [str(word) for word in words])


def test_command_lists_and_shows():
    listed = json.loads(run("--json").stdout)["effects"]
    assert [one["name"] for one in listed] == list(library())
    card = json.loads(run("backlash", "--json").stdout)
    assert {"name": "gap_mm", "unit": "mm", "lower": None, "upper": None}.items() <= card["parameters"][0].items()
    text = run("once-per-rev[harmonic 2]").stdout
    assert text.startswith("once-per-rev[harmonic 2] (drive; three-ptt, serial)")
    assert "ISO 3408-3" in text
    assert isinstance(run("baklash").exception, ModelError)
    assert isinstance(run("backlash", "windup").exception, InputError)


def test_command_writes_checks_and_draws(tmp_path):
    path = tmp_path / "drag.py"
    named = run("new", "cable-drag", "--out", path.with_suffix(".csv"))  # nothing would read it there
    assert "let its name end in .py" in str(named.exception) and not path.with_suffix(".csv").exists()
    assert run("new", "cable-drag", "--out", path).exit_code == 0
    assert "already exists" in str(run("new", "cable-drag", "--out", path).exception)
    assert json.loads(run("check", path, "--json").stdout)["passed"] is True
    assert run("cable-drag", "--effects", path, "--plot", tmp_path).exit_code == 0
    assert (tmp_path / "cable-drag.png").read_bytes().startswith(b"\x89PNG")
    path.write_text(path.read_text().replace("torch.eye(3, 2,", "torch.eye(3, 1,"))
    outcome = run("check", path)
    assert isinstance(outcome.exception, ModelError)
    assert "BROKEN" in outcome.stdout
    assert "checks fail, first 'shapes and numbers' of cable-drag" in str(outcome.exception)


def test_atlas_draws_an_arm_too(tmp_path, monkeypatch):
    monkeypatch.setattr("ptt.show.plots.atlas.GRID", 31)
    path = tmp_path / "arm.py"
    path.write_text(template("arm-drag").replace('("three-ptt",)', '("serial",)'))
    assert run("arm-drag", "--effects", path, "--plot", tmp_path).exit_code == 0
    assert (tmp_path / "arm-drag.png").stat().st_size > 10_000
