"""Ways out that messages name by an option of the command line, by the control that the page has for it."""

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
"""What the library says -> what the page says; an option that the page has no control for stays as it is."""


def on_page(text: str) -> str:
    """A message as the page has it.

    Args:
        text: of the library.
    """
    for said, instead in CONTROLS.items():
        text = text.replace(said, instead)
    return text
