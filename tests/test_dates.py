"""Dates: of a file's name, and as days since 1970."""

import time
from datetime import date, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ptt.run.dates import date_in_name, day_at, days_of


@given(st.datetimes(datetime(1960, 1, 1), datetime(2200, 1, 1)))
def test_any_time_of_a_day_belongs_to_it(when: datetime) -> None:
    assert day_at(days_of(when)) == when.date()


@pytest.mark.skipif(not hasattr(time, "tzset"), reason="the zone of a process cannot be set here")
@pytest.mark.parametrize("zone", ["UTC", "Pacific/Auckland", "America/Los_Angeles"])
def test_a_day_is_the_same_wherever_the_program_runs(zone: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", zone)
    time.tzset()
    try:
        assert days_of(datetime(1970, 1, 2)) == 1.0 and days_of(datetime(1970, 1, 2, 12)) == 1.5
    finally:
        monkeypatch.undo()
        time.tzset()


def test_a_date_in_a_name_is_the_first_that_is_one() -> None:
    assert date_in_name("2026-13-40 then 20260315.csv") == date(2026, 3, 15)
    assert date_in_name("run 12.csv") is None
