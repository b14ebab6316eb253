"""Words of German and French column titles, beside the English and Chinese ones that `titles` holds; and months."""

GERMAN = {
    "cmd": ("sollwert", "sollposition", "vorgabe"),
    "meas": ("istwert", "istposition", "gemessen", "messwert"),
    "std": ("standardabweichung",),
    "joint": ("achse", "gelenk"),
    "slider": ("schlitten", "läufer", "laeufer"),
    "dir": ("richtung",),
    "tau": ("drehmoment",),
    "name": ("messpunkt", "bezeichnung", "punktbezeichnung", "punktnummer"),
    "role": ("rolle",),
    "run": ("lauf", "messlauf"),
    "repeat": ("wiederholung", "zyklus"),
    "time": ("zeitstempel", "uhrzeit"),
    "payload": ("nutzlast", "traglast", "zuladung", "last"),
    "feed": ("vorschub", "geschwindigkeit"),
    "": ("höhe", "hoehe", "winkel"),
}
LOADS = (
    "load", "mass", "masse", "beladung", "belastung", "zusatzlast", "质量", "weight", "gewicht", "poids", "重量",
)  # fmt: skip
"""Words that mean a payload where their unit is one of mass, and else a motor's load or nothing that is known."""
DRIVES = (
    "motor", "antrieb", "actuator", "aktor", "aktuator", "drive", "servo", "wagen", "säule", "saeule", "turm", "tower",
    "moteur", "vérin", "verin", "actionneur", "电机", "电缸", "马达", "驱动", "驱动器", "立柱",
)  # fmt: skip
"""What moves a joint: with a number and a unit of length a slider, with one of angle a joint."""
STATISTICS = (
    "mean", "average", "avg", "median", "rms", "std", "stddev", "stdev", "standarddeviation", "sigma", "statistics",
    "mittelwert", "mittel", "durchschnitt", "stdabw", "standardabweichung", "anzahlpunkte", "statistik",
    "moyenne", "médiane", "écarttype", "ecarttype", "statistiques",
    "平均", "平均值", "均值", "标准差", "标准偏差", "中位数", "统计",
)  # fmt: skip
"""What a row below the readings is called, and no point."""
EXTREMES = (
    "max", "maximum", "min", "minimum", "range", "count", "sum", "spannweite", "anzahl", "summe", "最大值", "最小值",
)  # fmt: skip
"""What such a row may be called, and a point as well."""
FRENCH = {
    "cmd": ("consigne", "cible", "théorique", "theorique", "commandé", "commande"),
    "meas": ("mesuré", "mesure", "réel", "reel"),
    "std": ("écarttype", "ecarttype"),
    "joint": ("axe",),
    "slider": ("chariot", "coulisseau", "curseur"),
    "dir": ("sens",),
    "tau": ("couple",),
    "name": ("nomdupoint", "désignation", "designation"),
    "role": ("rôle",),
    "run": ("essai",),
    "repeat": ("répétition",),
    "time": ("temps", "heure", "horodatage"),
    "payload": ("charge",),
    "temp": ("température",),
    "feed": ("vitesse", "avance"),
    "": ("hauteur",),
}
DATES = ("date", "datum", "messdatum", "jour", "日期", "日期时间", "测量日期")
TIMES = ("time", "zeit", "uhrzeit", "messzeit", "heure", "temps", "时间", "时刻")
"""What a column of dates is called, and what may stand beside that in its title."""
_MONTHS = (
    ("january", "jan", "januar", "jän", "jänner", "janvier", "janv"),
    ("february", "feb", "februar", "février", "fevrier", "févr", "fevr"),
    ("march", "mar", "märz", "maerz", "mär", "mrz", "mars"),
    ("april", "apr", "avril", "avr"),
    ("may", "mai"),
    ("june", "jun", "juni", "juin"),
    ("july", "jul", "juli", "juillet", "juil"),
    ("august", "aug", "août", "aout"),
    ("september", "sep", "sept", "septembre"),
    ("october", "oct", "oktober", "okt", "octobre"),
    ("november", "nov", "novembre"),
    ("december", "dec", "dezember", "dez", "décembre", "decembre", "déc"),
)
MONTHS = {word: number for number, words in enumerate(_MONTHS, start=1) for word in words}
"""What a date calls each month, from 1: English, German, French."""
