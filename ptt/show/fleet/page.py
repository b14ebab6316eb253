"""The report on a fleet as one HTML file without scripts or external resources."""

from datetime import datetime
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from ptt.files import write_text
from ptt.fleet.overview import Overview, Standing
from ptt.show.card.words import together
from ptt.show.fleet.pictures import draw_fleet, draw_machine
from ptt.show.report.pictures import data_uri

# Verdicts from the most to the least urgent: the order of counts, and of machines with as many alarms.
VERDICTS = ("failed", "setup", "new", "unknown", "changed", "missing", "accepted", "same", "nothing-missing",
            "waiting")  # fmt: skip


def write_page(overview: Overview, out: str | Path) -> None:
    """Write the page, whole or not at all.

    Args:
        overview: the present state of the fleet.
        out: HTML file to write.

    Raises:
        InputError: it cannot be written.
    """
    write_text(out, render(overview))


def render(overview: Overview) -> str:
    """The page as HTML; all names and words are escaped, as they come from users."""
    environment = Environment(
        loader=PackageLoader("ptt.show.fleet"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, finalize=lambda said: together(said) if type(said) is str else said,
    )  # fmt: skip
    machines = sorted(overview.machines, key=_urgency)
    verdicts = [machine.verdict for machine in machines]
    return environment.get_template("fleet.html").render(
        machines=machines,
        counts=[(verdict, verdicts.count(verdict)) for verdict in VERDICTS if verdict in verdicts],
        runs=sum(len(machine.past) for machine in machines),
        fleet=[data_uri(png) for png in draw_fleet(machines)],
        pictures={machine.machine: data_uri(png) for machine in machines if (png := draw_machine(machine)) is not None},
        style=Markup(environment.loader.get_source(environment, "fleet.css")[0]),  # type: ignore[union-attr]
        written=datetime.now().date().isoformat(),
    )


def _urgency(machine: Standing) -> tuple[int, int, str]:
    """Sort key: machines with more alarms first, then by verdict and name."""
    place = VERDICTS.index(machine.verdict) if machine.verdict in VERDICTS else 0
    return (-len(machine.alarms), place, machine.machine)
