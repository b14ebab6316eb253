"""The worked example prints what its page shows."""

from pathlib import Path

from test_docs_library import maker

ROOT = Path(__file__).resolve().parents[1]


def test_every_command_of_the_worked_example_prints_what_the_page_shows(tmp_path, monkeypatch):
    (tmp_path / "data").symlink_to(ROOT / "data")
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs" / "tutorial.md").read_text()
    assert len(list(maker("tutorial").commands(page))) >= 12
    assert not maker("tutorial").failures(page)


def test_another_word_figure_or_order_is_a_difference():
    printed = "Slider 2 loses 55.1 um\n──────\non reversal.\nNoise 5.8 um, p < 1e-12\n"
    differences = maker("tutorial").differences
    assert not differences("    Slider 2 loses 55.0 um on reversal.\n [...]\n p < 1e-9", printed)
    assert differences("Slider 2 wins 55.1 um", printed) == ["Slider 2 wins 55.1 um"]
    assert differences("Slider 3 loses 55.1 um", printed)
    assert differences("Slider 2 loses 75.1 um", printed)
    assert differences("Noise 5.8 um [...] Slider 2", printed) == ["Slider 2"]
