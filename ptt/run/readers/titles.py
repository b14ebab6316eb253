"""What a column title of a tracker or robot export means: English, German, French and Chinese words, units in brackets.

A title is cut into known words; when nothing unknown is left over, the words say which quantity it is. A title with an
unknown word is never forced into a meaning: `measurement_rx` or `Goal roll` stay unread.
"""

import re
import unicodedata

from ptt.run.readers.columns import UNITS, Meaning, canonical, dimension_of, of_axis
from ptt.run.readers.words import DRIVES, FRENCH, GERMAN, LOADS

LONGEST_TITLE = 300  # characters; the longest title of an export seen has 60. What takes it apart is not linear

NEWTONS = ("n", "newton", "newtons", "牛")
_UNIT_WORDS = {
    "mm": ("mm", "毫米", "millimeter", "millimetre", "millimeters", "millimetres"),
    "um": ("um", "μm", "µm", "微米", "micron", "microns", "micrometer"),
    "cm": ("cm", "厘米"),
    "m": ("m", "米", "meter", "metre", "meters", "metres"),
    "in": ("in", "inch", "inches", "英寸", '"'),
    "rad": ("rad", "弧度", "radian", "radians"),
    "deg": ("deg", "°", "度", "degree", "degrees", "grad"),
    "s": ("s", "sec", "秒", "second", "seconds"),
    "ms": ("ms", "毫秒"),
    "min": ("min", "分", "分钟"),
    "h": ("h", "小时"),
    "kg": ("kg", "千克", "公斤"),
    "g": ("g", "克"),
    "lb": ("lb", "lbs", "pound", "pounds", "磅"),
    "c": ("c", "°c", "degc", "摄氏度", "celsius"),
    "k": ("k", "kelvin", "开"),
    "f": ("f", "°f", "degf", "华氏度", "fahrenheit"),
    "mm_s": ("mm/s", "毫米/秒", "mm_s"),
    "mm_min": ("mm/min", "毫米/分", "毫米/分钟", "mm_min"),
    "m_s": ("m/s", "米/秒", "m_s"),
    "m_min": ("m/min", "米/分", "米/分钟", "m_min"),
    "in_min": ("in/min", "inch/min", "inches/min", "ipm", "英寸/分", "英寸/分钟", "in_min"),
    "kn": ("kn", "千牛"),
    "knm": ("knm", "kn*m", "kn·m"),
    "ncm": ("ncm", "n*cm", "n·cm"),
    "nmm": ("nmm", "n*mm", "n·mm"),
    "": (*NEWTONS, "nm", "n*m", "n·m", "牛米", "-", "1"),
}
UNIT_OF_WORD = {word: unit for unit, words in _UNIT_WORDS.items() for word in words}

_WORDS = {
    "cmd": ("commanded", "command", "cmd", "target", "goal", "nominal", "nom", "soll", "desired", "setpoint",
            "目标", "指令", "命令", "理论", "名义", "给定", "期望", "设定"),
    "meas": ("measurement", "measured", "meas", "actual", "act", "ist", "tracker", "reading", "实测", "测量", "实际",
             "测得", "跟踪仪"),
    "std": ("standarddeviation", "stddev", "stdev", "std", "sigma", "标准差", "标准偏差"),
    "joint": ("joint", "axis", "关节", "轴", "q", "j"),
    "slider": ("slider", "carriage", "滑块", "滑台", "b"),
    "drive": DRIVES,
    "turning": ("a", "theta", "θ"),
    "dir": ("direction", "dir", "方向"),
    "tau": ("torque", "tau", "力矩", "扭矩", "转矩"),
    "name": ("pointname", "pointid", "pointno", "pointnumber", "point", "name", "punkt", "punktname", "id",
             "点名称", "点名", "点号", "名称", "测点"),
    "role": ("role", "角色"),
    "run": ("runnumber", "run", "批次", "轮次", "趟次"),
    "repeat": ("repetition", "repeat", "cycle", "重复", "重复次数", "循环"),
    "time": ("timestamp", "datetime", "time", "zeit", "时间", "时刻", "时间戳"),
    "payload": ("payload", "负载", "载荷", "负荷"),
    "temp": ("temperature", "temp", "temperatur", "温度", "环境温度"),
    "feed": ("feedrate", "feed", "speed", "velocity", "速度", "进给速度", "进给"),
    "x": ("x",), "y": ("y",), "z": ("z",), "qx": ("qx",), "qy": ("qy",), "qz": ("qz",), "qw": ("qw",),
    "": ("coordinate", "coord", "position", "pos", "value", "angle", "坐标", "位置", "值", "角度", "角", "号", "第"),
}  # fmt: skip
_KIND_OF_WORD = {word: kind for some in (FRENCH, GERMAN, _WORDS) for kind, words in some.items() for word in words}
_TOKEN = re.compile("|".join([*sorted(map(re.escape, _KIND_OF_WORD), key=len, reverse=True), r"\d+"]))
_DRIVER_JOINTS = ("shoulderpanjoint", "shoulderliftjoint", "elbowjoint", "wrist1joint", "wrist2joint", "wrist3joint")
DRIVER_NOTE = "unit as the robot's ROS driver writes it"
_KUKA = re.compile(r"(?:axisact|e1)(?=a[1-9]\d*$)")  # $AXIS_ACT is where the controller wants the axes to be
_POLAR = re.compile(
    r"(hz|v|d|r|rho|theta|phi|azimuth|az|elevation|el|zenith|horizontal|vertical|range|distance|radius"
    r"|方位角|俯仰角|水平角|垂直角|天顶角|距离|斜距|半径|极角)"
)


def normalise(title: str) -> str:
    """A title in one spelling: compatibility forms folded (full-width letters, brackets), lower case, trimmed."""
    return unicodedata.normalize("NFKC", title).strip().lower()


def split_unit(title: str) -> tuple[str, str | None]:
    """Cut the unit off a title: `X [mm]`, `X(mm)`, `X/mm`, `X, mm`, `X_mm`, `X mm`.

    Args:
        title: as in the file.

    Returns:
        The normalised rest, and a key of `UNITS`, or the word itself in brackets where it is no known unit, or None.
    """
    rest, word = _cut_unit(normalise(title))
    return rest, None if word is None else UNIT_OF_WORD.get(word.replace(" ", ""), f"({word})")


def written_unit(title: str) -> str:
    """The unit of a title as the file writes it, for a person: `N` of `Payload [N]`; '' where it writes none."""
    return _cut_unit(unicodedata.normalize("NFKC", title).strip())[1] or ""


def stated_unit(title: str) -> str | None:
    """The unit that a title states, whether or not anything else in it is understood: `lb` of `Tool weight [lb]`.

    A letter without brackets behind unknown words may be a label (`Probe C`), and so may a number within them.

    Args:
        title: as in the file.

    Returns:
        As the second one of `split_unit`.
    """
    unit, word = split_unit(title)[1], written_unit(title)
    if unit is None or meaning_of(title):
        return unit
    bracketed = normalise(title).endswith(("]", ")"))
    is_label = word in "-1" or (unit.startswith("(") and not any(map(str.isalpha, word)))
    return None if is_label or (len(word) == 1 and not bracketed) else unit


def load_in_newtons(title: str) -> tuple[str, str] | None:
    """What `Load [N]` may be, and its unit as written: a payload, which is no force, or what a motor has to hold.

    Args:
        title: as in the file.

    Returns:
        The quantity and the unit, as `columns.begun`; None for any other title.
    """
    word = written_unit(title)
    is_load = re.sub(r"[\s_.:\-]+", "", split_unit(title)[0]) in LOADS
    return ("payload", word) if is_load and is_newton(word) else None


def _cut_unit(text: str) -> tuple[str, str | None]:
    """The rest of a title, and the word of its unit: any word in brackets, else one that is known."""
    match = re.fullmatch(r"(.*?)\s*[\[(](.*?)[\])]\s*", text)
    if match:
        return match[1].strip(), match[2].strip()
    for match in re.finditer(r"\s*/\s*|[,\s_]+", text):  # the longest unit first: feed_rate_mm_min is no time in min
        rest, word = text[: match.start()], text[match.end() :]
        if rest and word.lower() in UNIT_OF_WORD and word not in "-1":
            return rest, word
    return text, None


def is_newton(word: str) -> bool:
    """Whether a word is the unit of a force, which a scale for weights may show."""
    return word.lower() in NEWTONS


def is_unit_row(cells: list[str]) -> bool:
    """Whether a row under the titles holds units: nothing else, or more of them than of words such as `Text`.

    A row of `-` or of `1` alone is one of readings.
    """
    words = [word for cell in cells if (word := normalise(cell).strip("[]() "))]
    other = [word for word in words if word not in UNIT_OF_WORD]
    units = sum(bool(UNIT_OF_WORD.get(word)) for word in words)
    return any(word not in "-1" for word in words) and (
        not other or (len(other) < units and not any(map(str.isdigit, "".join(other))))
    )


def meaning_of(title: str) -> Meaning | None:
    """Meaning of a title.

    Args:
        title: as in the file.

    Returns:
        Quantity and unit (None where unstated). The quantity of a bare coordinate is `x`, `y` or `z` and that of a bare
        `b2` or `q2` ends on `_bare`: the other columns decide whether it is a command. None where not understood.
    """
    if len(title) > LONGEST_TITLE:
        return None
    known = canonical(title.strip())
    if known:
        return known
    text, unit = split_unit(title)
    named = canonical(text)
    if named and unit is not None and unit == named.unit and text != named.quantity:
        return named  # `time_s [s]`: said twice, and both alike
    text = re.sub(r"[\s_.:\-]+", "", text)
    if text in _DRIVER_JOINTS:
        return Meaning(f"q{_DRIVER_JOINTS.index(text) + 1}_cmd", unit or "rad", "" if unit else DRIVER_NOTE)
    if text in LOADS and unit in UNITS["mass"]:
        return Meaning("payload", unit)
    if scatter := re.fullmatch(r"s([xyz])", text):
        return Meaning(f"{scatter[1]}_std", unit, likely=True) if unit in UNITS["length"] else None
    if text == "t":
        return Meaning("temp", unit, likely=True) if unit in UNITS["temperature"] and _is_marked(title) else None
    text = _KUKA.sub("axis", text)
    tokens = _TOKEN.findall(text)
    if "".join(tokens) != text or not tokens:
        return None
    kinds = [kind for kind in (_KIND_OF_WORD.get(token, token) for token in tokens) if kind]
    if quantity := _compose(kinds, text):
        return of_axis(Meaning(quantity, unit))
    return _driven(kinds, unit)


def _is_marked(title: str) -> bool:
    """Whether a unit cannot be another word: between brackets, or with a sign of degrees."""
    return normalise(title).endswith(("]", ")")) or "°" in title


def _driven(kinds: list[str], unit: str | None) -> Meaning | None:
    """A joint by the name of what drives it: `Motor 1 [mm]`, `Actuator 2 [deg]`, KUKA's `A1 [°]`, `1 号滑块 [mm]`."""
    subject = [kind for kind in kinds if kind != "cmd"]
    numbers = [kind for kind in subject if kind.isdigit() and int(kind) > 0]
    words = tuple(kind for kind in subject if not kind.isdigit())
    if len(numbers) != 1 or len(words) + 1 != len(subject):
        return None
    is_driven = words in (("drive",), ("joint", "drive"), ("slider", "drive"))
    is_turned = words in (("turning",), ("joint", "turning")) and subject[-1] == numbers[0]
    if not (is_driven or is_turned or words in (("joint",), ("slider",))):
        return None
    slides, turns = unit in UNITS["length"], unit in UNITS["angle"]
    named = "joint" in words and ("cmd" in kinds or is_turned)  # its unit is asked for, as that of any joint
    if slides and not is_turned:
        return Meaning(f"b{numbers[0]}_cmd", unit, likely=True)
    if (turns and "slider" not in words) or (unit is None and named):
        return Meaning(f"q{numbers[0]}_cmd", unit, likely=True)
    return None


def _compose(kinds: list[str], text: str) -> str | None:
    """Put word kinds together to a quantity."""
    subject = _without_carrier([kind for kind in kinds if kind not in ("cmd", "meas", "std")])
    role = "std" if "std" in kinds else next((kind for kind in kinds if kind in ("cmd", "meas")), "")
    if len(subject) == 1 and subject[0] in ("x", "y", "z"):
        return f"{subject[0]}_{role}" if role else subject[0]
    if len(subject) == 1 and dimension_of(f"{subject[0]}_{role}"):
        return f"{subject[0]}_{role}"
    if len(subject) == 2 and subject[1].isdigit() and int(subject[1]) > 0:
        return _numbered(subject[0], int(subject[1]), role, text)
    if len(subject) == 1 and role != "std" and dimension_of(subject[0]) and not subject[0].isdigit():
        return subject[0] if role != "cmd" else None
    return None


def _without_carrier(subject: list[str]) -> list[str]:
    """`x axis` is x, and `joint 2 torque` is torque 2."""
    main = [kind for kind in subject if kind in ("x", "y", "z", "tau", "dir")]
    return main + [kind for kind in subject if kind not in (*main, "joint", "slider")] if main else subject


def _numbered(kind: str, number: int, role: str, text: str) -> str | None:
    if kind in ("dir", "tau"):
        return f"{kind}{number}" if role != "std" else None
    if kind in ("joint", "slider") and role in ("", "cmd"):
        letter = "q" if kind == "joint" else "b"
        return f"{letter}{number}_bare" if re.fullmatch(r"[qb]\d+", text) else f"{letter}{number}_cmd"
    return None


def is_polar(title: str) -> bool:
    """Whether a title names an angle or a distance of polar, spherical or cylindrical coordinates."""
    text, _ = split_unit(title)
    return bool(_POLAR.fullmatch(re.sub(r"[\s_.:\-]+|angle$", "", text)))
