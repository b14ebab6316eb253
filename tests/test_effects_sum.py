"""Effects together: any order, the same kind twice, nothing at zero, and files with a wrong one."""

import pytest
import torch
from small_files import BARE
from test_effects_physics import POSES, tensor
from torch.testing import assert_close

from ptt.effects import library
from ptt.effects.bench import sample_view
from ptt.effects.case import make_case, usual_theta
from ptt.effects.layout import total_size
from ptt.errors import ModelError
from ptt.machine import parse_machine
from ptt.model.chain import differentiate, predict
from ptt.model.entries import read_model
from ptt.model.model import Model
from ptt.run.table import make_table
from ptt.run.viewing import build_view

pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated:DeprecationWarning")
THREE_PTT = [name for name, cls in library().items() if "three-ptt" in cls.mechanisms]


def model_of(bench, *names):
    model = Model(bench)
    for name in names:
        model = model + library()[name]()
    return model


def test_order_of_adding_does_not_matter(bench):
    names = ["setup-jump", "backlash", "link-length", "column-bend", "homing-offset"]
    assert model_of(bench, *names).keys == model_of(bench, *reversed(names)).keys
    assert model_of(bench, *names).keys == ("backlash", "homing-offset", "link-length", "column-bend", "setup-jump")


def test_the_same_twice_is_refused_and_two_of_a_kind_are_not(bench):
    with pytest.raises(ModelError, match="in the model already"):
        model_of(bench, "backlash", "backlash")
    knock = library()["setup-jump"]
    model = Model(bench) + knock("first") + knock("second")
    assert model.keys == ("setup-jump[first]", "setup-jump[second]")
    assert model.without("setup-jump[first]").keys == ("setup-jump[second]",)


def test_two_knocks_add_up(bench):
    view = build_view(bench, make_table(POSES, time_s=[0.0, 100.0, 200.0, 300.0]))
    knock, still = library()["setup-jump"], [0.0, 0.0, 0.0]
    terms = [(knock("a"), tensor([0.1, 0, 0, *still, 50.0])), (knock("b"), tensor([0, 0.2, 0, *still, 250.0]))]
    expected = [[0, 0, 0], [0.1, 0, 0], [0.1, 0, 0], [0.1, 0.2, 0]]
    assert_close(predict(terms, view).reading - view.p, tensor(expected), atol=1e-12, rtol=0.0)


def test_effects_sum_to_the_whole_in_any_order():
    view = sample_view("three-ptt")
    cases = [make_case(library()[name](), "three-ptt", differentiate) for name in THREE_PTT]
    terms = [(case.effect, case.theta * 1e-3) for case in cases]
    whole = predict(terms, view).reading - view.p
    alone = [predict([term], view).reading - view.p for term in terms]
    assert_close(sum(alone), whole, rtol=0.0, atol=1e-5 * float(whole.abs().max()))
    shuffled = predict(terms[::-1], view)
    assert_close(shuffled.reading - view.p, whole, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", THREE_PTT)
def test_zero_amplitudes_read_nominal(name):
    view, effect = sample_view("three-ptt"), library()[name]()
    shape = effect.search(view)[0]
    theta = usual_theta(effect, "three-ptt", view, shape) * 0.0
    start = total_size(effect, 3) - sum(len(torch.as_tensor(value)) for value in shape.values())
    if shape:
        theta[start:] = torch.cat([torch.as_tensor(shape[p.stem]) for p in effect.parameters if p.role != "linear"])
    assert_close(predict([(effect, theta)], view).reading, view.p, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[[effect]]\nname = "backlsh"', "did you mean 'backlash'"),
        ('[[effect]]\nname = "backlash"\n[[effect]]\nname = "backlash"', "in the model already"),
        ('[[effect]]\nname = "backlash"\n[effect.parameters]\ngap = { value = 0.1 }', "it has: gap_mm"),
        (
            '[[effect]]\nname = "backlash"\n[effect.parameters]\ngap_mm = { value = [0.1, 0.2] }',
            "has 2 values; give one, or 3",
        ),
        ('[[effect]]\nname = "windup"\n[effect.parameters]\nheight_mm = { value = 0.1 }', "'length_mm' is missing"),
        (
            '[[effect]]\nname = "windup"\n[effect.parameters]\nheight_mm = { value = 0.1 }\n'
            "length_mm = { value = [1, 2] }",
            "'length_mm' has 2 values; give one, or 3",
        ),
    ],
)
def test_a_machine_file_with_a_wrong_effect_is_refused(text, said):
    with pytest.raises(ModelError, match=r"\[\[effect\]\]") as caught:
        read_model(parse_machine(f"{BARE}\n{text}", "bad.toml"))
    assert said in str(caught.value) and "or 1" not in str(caught.value)
    assert str(caught.value).startswith("bad.toml")
