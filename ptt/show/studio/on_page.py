"""Messages of the library for the page: advice that names command-line options names the page's controls instead."""

COLUMNS = "under 'Check the columns' on Load"
TARGETS = "on Load under 'A further run, or targets of an export'"
CONTROLS = {
    "say with --map FILE.toml which one it is": f"say which one it is {COLUMNS}",
    "say what they hold with --map FILE.toml": f"say what they hold {COLUMNS}",
    "give their unit in a file for --map": f"give their unit {COLUMNS}",
    "say the encoding with --map FILE.toml": "save it as UTF-8",
    "readings alone are paired with --targets T.csv": f"readings alone are paired with their targets {TARGETS}",
    "give them with --targets T.csv": f"give them {TARGETS}",
    "`ptt check` writes cured files, --anyway goes on": "open it on Load, where it can be put right or taken anyway",
    "solve the machine first: `ptt diagnose`, then `ptt add ... --out solved.toml`": "first add what Result finds",
    "as --set order=rows says": "as was answered",
    "--payloads": "payloads [kg]",
}
"""Advice of the library -> advice on the page; options for which the page has no control stay as they are."""


def on_page(text: str) -> str:
    """A message of the library in the page's words."""
    for said, instead in CONTROLS.items():
        text = text.replace(said, instead)
    return text
