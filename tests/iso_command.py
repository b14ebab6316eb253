"""The verb for the figures of ISO 230-2 and ISO 9283 by itself."""

import pytest
import typer


@pytest.fixture
def app():
    from ptt.commands.iso import iso

    app = typer.Typer()
    app.command()(iso)
    return app
