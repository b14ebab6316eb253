"""Effects of one's own: a template that works, files that are refused, methods that fail."""

import pytest
import torch

from ptt.effects import library
from ptt.effects.bench import sample_view
from ptt.effects.contract import check_effect
from ptt.effects.own import load_effects
from ptt.effects.registry import make_effect, parse_key
from ptt.effects.template import template
from ptt.errors import InputError, ModelError
from ptt.model.chain import differentiate

pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")


def test_template_works_as_written(tmp_path):
    path = tmp_path / "own.py"
    path.write_text(template("cable-drag"))
    cls = load_effects(path)["cable-drag"]
    assert all(finding.passed for finding in check_effect(cls(), differentiate))
    assert cls.__name__ == "CableDrag"
    assert set(library(path)) == {*library(), "cable-drag"}


@pytest.mark.parametrize(("name", "said"), [("Cable Drag", "not a name"), ("backlash", "taken"), ("check", "taken")])
def test_template_refuses_a_name(name, said):
    with pytest.raises(InputError, match=said):
        template(name)


OWN = """
from __future__ import annotations
from dataclasses import dataclass
from typing import ClassVar
from ptt.effects import Effect, Parameter

@dataclass(frozen=True)
class One(Effect):
    name: ClassVar[str] = "NAME"
    stage: ClassVar[str] = "STAGE"
    parameters: ClassVar[tuple[Parameter, ...]] = (PARAMETERS,)
"""
LINEAR, SEARCHED = 'Parameter("a", "mm", 1.0, "a")', 'Parameter("b", "mm", 1.0, "b", role="searched")'


@pytest.mark.parametrize(
    ("stage", "parameters", "name", "said"),
    [
        ("drive", LINEAR, "backlash", "exists already"),
        ("nowhere", LINEAR, "own", "stage 'nowhere' of own is not known"),
        ("drive", f"{SEARCHED}, {LINEAR}", "own", "linear ones first"),
        ("drive", SEARCHED, "own", "need a linear one"),
        ("drive", LINEAR, "", "has no name"),
    ],
)
def test_own_file_is_refused(tmp_path, stage, parameters, name, said):
    path = tmp_path / "own.py"
    path.write_text(OWN.replace("NAME", name).replace("STAGE", stage).replace("PARAMETERS", parameters))
    with pytest.raises(InputError, match=said) as caught:
        library(path)
    assert str(path) in str(caught.value)


def test_what_an_own_effect_stands_for_are_names(tmp_path):
    path = tmp_path / "own.py"
    text = OWN.replace("NAME", "own").replace("STAGE", "drive").replace("PARAMETERS", LINEAR)
    path.write_text(f"{text}    stands_for: ClassVar[int] = 2\n")
    with pytest.raises(InputError, match="stands_for = 2 is not a tuple of names"):
        library(path)


def test_own_file_with_postponed_annotations_loads(tmp_path):
    path = tmp_path / "own.py"
    path.write_text(OWN.replace("NAME", "own").replace("STAGE", "drive").replace("PARAMETERS", LINEAR))
    assert library(path)["own"]("left").key == "own[left]"


@pytest.mark.parametrize(
    ("text", "said"), [("1 / 0", "ZeroDivisionError"), ("x = = 1", "SyntaxError"), ("x = 1", "defines no effect")]
)
def test_own_file_that_does_not_run_is_refused(tmp_path, text, said):
    path = tmp_path / "own.py"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        load_effects(path)


@pytest.mark.parametrize(
    "method", ["undecided(self, view)", "usual_trial(self, view)", "differentiable_shift(self, theta, view)"]
)
def test_an_own_method_that_fails_says_where(tmp_path, method):
    """Whichever the fit calls: all that an effect may define is guarded, by no list that could fall behind."""
    path = tmp_path / "own.py"
    text = OWN.replace("NAME", "own").replace("STAGE", "drive").replace("PARAMETERS", LINEAR)
    path.write_text(f"{text}\n    def {method}:\n        return 1 / 0\n")
    name, _, rest = method.partition("(self, ")
    own = library(path)["own"]()
    with pytest.raises(InputError, match=rf"own\.py line 14.*{name} of own fails: ZeroDivisionError"):
        getattr(own, name)(*rest.rstrip(")").split(", "))


@pytest.mark.parametrize(
    ("parameters", "further", "said"),
    [
        (f'{LINEAR}, Parameter("a_mm", "1", 1.0, "other")', "", "two parameters have one name.*a_mm, a_mm"),
        ('Parameter("a", "mm", 1.0, "a", axis=True, usual_rad=0.0)', "", "usual size 0, not a positive one"),
        ('Parameter("a", "mm", 1.0, "a", most="5")', "", "bounds are numbers"),
        ('Parameter("a", "mm", 1.0, "a", default="x")', "", "default and bounds are numbers"),
        ('Parameter("a", "mm", 1.0, "a", within=(1.0,))', "", "within = .* not two numbers"),
        ('Parameter("a", "mm", 1.0, "a", lent=("lead-scale", "homing-offset"))', "", "lent = .* one for each of 1"),
        (LINEAR, 'least_joints = "3"', "not a whole number"),
        (LINEAR, 'phrases = "abc"', r"not a tuple of Phrase"),
        (LINEAR, 'phrases = (Phrase("a", "is {what} {axis}", "y"),)', r"'is \{what\} \{axis\}' has a place"),
        (LINEAR, 'phrases = (Phrase("a", "x", "y", mend=("turn {whom}", "")),)', "has a place that is none of"),
    ],
)
def test_attributes_that_would_fail_later_are_refused(tmp_path, parameters, further, said):
    """Some of them failed behind a fit, or once the model was written."""
    path = tmp_path / "own.py"
    path.write_text(
        "from ptt.effects import Effect, Parameter, Phrase\n\nclass One(Effect):\n    name = 'one'\n"
        f"    parameters = ({parameters},)\n    {further}\n"
    )
    with pytest.raises(InputError, match=said):
        load_effects(path)


SHIFT = """
import torch
from ptt.effects import Effect, Parameter

class Bow(Effect):
    name = "bow"
    stage = "drive"
    mechanisms = ("three-ptt",)
    parameters = (Parameter("size", "mm", 0.02, "size", per_joint=True),)

    def shift(self, theta, view):
        return torch.sin(3.0 * theta) * ((view.q - view.home) / 100.0) ** 2
"""


def test_an_own_effect_may_have_a_shift_alone(tmp_path):
    """What searches and fits start from is then its derivative where all values are zero."""
    path = tmp_path / "own.py"
    path.write_text(SHIFT)
    own, view = library(path)["bow"](), sample_view("three-ptt")
    wanted = 3.0 * ((view.q - view.home) / 100.0) ** 2
    torch.testing.assert_close(own.basis(view, {}), torch.diag_embed(wanted))
    assert all(finding.passed for finding in check_effect(own, differentiate))


def test_own_file_with_a_name_twice_is_refused(tmp_path):
    path = tmp_path / "own.py"
    path.write_text(template("drag") + template("drag").replace("class Drag", "class Other"))
    with pytest.raises(InputError, match="twice"):
        load_effects(path)


def test_unknown_name_is_suggested():
    with pytest.raises(ModelError, match="did you mean 'backlash'"):
        make_effect(library(), "baklash")
    with pytest.raises(ModelError, match=r"--effects FILE\.py"):
        make_effect(library(), "zzz")
    assert parse_key("setup-jump[second]") == ("setup-jump", "second")
    assert parse_key("backlash") == ("backlash", "")
    with pytest.raises(ModelError, match=r"opens a label and does not close it; write setup-jump\[label\]"):
        parse_key("setup-jump[second")
