"""`ptt` with the words of a command line, run in this process."""

import pytest
from click.testing import Result
from typer.testing import CliRunner

from ptt.commands.main import app, run_alone


def invoke(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def run_verb(verb: str, *arguments: object) -> int:
    """The exit code of one verb, as `ptt.commands.main.run_alone` ends with it."""
    with pytest.raises(SystemExit) as ended:
        run_alone(verb, [str(argument) for argument in arguments])
    return int(ended.value.code or 0)
