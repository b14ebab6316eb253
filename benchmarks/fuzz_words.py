"""What the fuzzer does to command lines: options, values, and outputs where they must not go."""

import contextlib
import os
import random
import stat
from pathlib import Path

from fuzz_mutation import Mutation

VALUES = (
    "", " ", "nan", "inf", "-1", "0", "1e308", "1e-308", "9" * 400, "abc", "x" * 30_000, "\u202e", "--", "-", ".", "..",
    "nowhere/at/all", "a\nb", "1,2,3", "1,2", "nan,1,1", ",", "é", "\udcff", "1e400", "run.csv", "comp",
)  # fmt: skip
OPTIONS = (
    "--lead", "--turns", "--resolution-um", "--rows", "--seed", "--set", "--map", "--limit-mm", "--box",
    "--payloads", "--steps",
    "--goal", "--frame", "--z-datum", "--repeats", "--reversal", "--effects", "--also", "--targets", "--hold-out",
    "--no-such",
    "--plots", "--model", "--out", "--chunk-rows", "--truth", "--out-run", "--out-model", "--measure-next",
    "--plot", "--drawing", "--to", "--step", "--run", "--chord-um", "--offset", "--start", "--date",
)  # fmt: skip
SETTINGS = (
    "payload_kg=2", "payload_kg=nan", "payload_kg=1e308", "payload_kg", "=", "order=time", "order=no", "x_std=-1",
    "x_std=0",
    "temp_c=1e150", "temp_c=-500", "payload_kg=" + "9" * 500, "feed_mm_s=0", "feed_mm_s=-3", "a=b=c",
    "payload_kg=-1", "order=",
)  # fmt: skip
MUST_REFUSE = ("payload_kg=nan", "payload_kg=1e308", "order=no", "temp_c=1e150", "x_std=-1")


def mutate_words(words: list[str], place: Path, rng: random.Random) -> tuple[list[str], Mutation]:
    """Change a command line.

    Args:
        words: a sound one.
        place: the folder that it runs in.
        rng: where chance comes from.

    Returns:
        The new one and what was done.
    """
    kind = rng.choice(("value", "value", "option", "set", "drop", "twice", "output", "output", "swap", "special"))
    words, at = list(words), rng.randrange(1, len(words))
    if kind == "value":
        words[at] = rng.choice(VALUES)
    elif kind == "option":
        words += [rng.choice(OPTIONS), rng.choice(VALUES)]
    elif kind == "set":
        setting = rng.choice(SETTINGS)
        words += ["--set", setting]
        return words, Mutation(f"--set {setting[:30]}", "refuse" if setting in MUST_REFUSE else "")
    elif kind == "drop":
        del words[at]
    elif kind == "twice":
        words.insert(at, words[at])
    elif kind == "swap":
        other = rng.randrange(1, len(words))
        words[at], words[other] = words[other], words[at]
    elif kind == "special":
        words[at] = rng.choice(_specials(place))
    else:
        return _output(words, place, rng)
    return words, Mutation(f"words {kind}: {' '.join(words)[:200]!r}")


def _specials(place: Path) -> list[str]:
    """Things that are no plain files: a pipe nobody writes to, devices, a link to itself, one to nowhere.

    The devices are the folder's own: whoever may replace them replaces nothing of the machine.
    """
    if not (place / "pipe").exists():
        os.mkfifo(place / "pipe")
        (place / "loop").symlink_to("loop")
        (place / "link.csv").symlink_to("run.csv")
        (place / "gone.csv").symlink_to("nowhere.csv")
        for name, minor in (("null", 3), ("zero", 5), ("full", 7)) if os.geteuid() == 0 else ():
            with contextlib.suppress(OSError):  # not in every container
                os.mknod(place / name, stat.S_IFCHR | 0o666, os.makedev(1, minor))
    return ["pipe", "zero", "loop", "link.csv", "gone.csv", "full", "null"]


def _output(words: list[str], place: Path, rng: random.Random) -> tuple[list[str], Mutation]:
    """Send the output onto something that is there, itself or through a link."""
    options = [i for i, word in enumerate(words) if word in ("--out", "--out-run", "--out-model", "--truth", "--map")]
    if not options:
        option = rng.choice(
            ("--out", "--plots", "--out-model", "--truth", "--plot", "--drawing", "--measure-next", "--rig")
        )
        words += [option, ""]
        options = [len(words) - 2]
    inputs = [word for word in words if (place / word).is_file()] or ["machine.toml"]
    target = rng.choice(
        (rng.choice(inputs), rng.choice(inputs), "comp", ".", "own.py", "run.csv", "model.toml", "found.json")
    )
    if rng.random() < 0.3:
        (place / "way.csv").symlink_to(target)
        target = "way.csv"
    elif rng.random() < 0.1:
        target = f"{target}/below.csv"
    words[options[0] + 1] = target
    return words, Mutation(f"output onto {target}: {' '.join(words)[:200]!r}")
