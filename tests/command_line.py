"""`ptt` with the words of a command line, run in this process."""

from click.testing import Result
from typer.testing import CliRunner

from ptt.commands.main import app


def invoke(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])
