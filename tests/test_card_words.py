"""What the result card says of a machine in which nothing is missing."""

import pytest
from made_runs import empty_run, machine, measure

from ptt.diagnosis.diagnose import diagnose
from ptt.model.model import Model
from ptt.run.problem import build_problem
from ptt.show.card.result import card_of_diagnosis
from ptt.show.report.words import words_of


@pytest.mark.parametrize("stated", [0.0018, 0.002, 0.006])
def test_no_error_is_called_less_than_a_scatter_that_it_exceeds(stated: float) -> None:
    """Beside a stated figure that is too small nothing is missing, and still more is left than that figure."""
    file, table = machine(sigma_mm=stated), empty_run(60)
    problem = build_problem(file, measure(table, file, [], noise=0.003))
    found = diagnose(Model(file), problem)
    card = card_of_diagnosis(found, problem)
    assert found.verdict == "nothing-missing"
    assert ("no more than the scatter" in card.words) == (card.left_um <= card.noise_um) == (stated == 0.006)
    over = card.left_um / card.noise_um
    assert (f"This is {over:.1f} times the noise" in card.words) == (over >= 1.5)
    assert not any(word in words_of("zh")(card.words) for word in ("scatter", "noise"))
