"""From bytes to text: the codec that a file was written with."""

import re

from ptt.errors import TableError
from ptt.run.readers.mapping import Ask, Mapping, answer

ZEROS = 0.02  # share of zero bytes: in UTF-16 every ASCII character has one, in single-byte text there is none


def decode(data: bytes, source: str, mapping: Mapping, ask: Ask | None) -> tuple[str, str]:
    """Text of a file and the codec it was read with."""
    if data.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")):
        raise TableError("an Excel workbook, not text", where=source, fix="save the sheet as CSV")
    encoding = mapping.encoding or find_encoding(data, source, ask)
    try:
        text = data.decode(encoding).removeprefix("\ufeff")
    except (UnicodeDecodeError, LookupError) as error:
        what = f"not text in '{encoding}' ({error})"
        raise TableError(what, where=source, fix="say the encoding with --map FILE.toml") from None
    _refuse_signs(text, source)
    return text, encoding


def _refuse_signs(text: str, source: str) -> None:
    """Refuse control characters that no text has."""
    if sign := re.search(r"[\x00-\x08]", text):
        row = text.count("\n", 0, sign.start()) + 1
        what = f"not a text file: a character of code {ord(sign[0])}"
        raise TableError(what, where=f"{source} row {row}", fix="export the readings as CSV or text")


def find_encoding(data: bytes, source: str, ask: Ask | None) -> str:
    """Codec of a file: byte-order mark, zero bytes of UTF-16, valid UTF-8, else GBK or Western by their byte pairs."""
    if data.startswith(b"\xef\xbb\xbf"):
        return "utf-8-sig"
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    zeros = [data[offset:4000:2].count(0) for offset in (0, 1)]
    if max(zeros) > ZEROS * len(data[:4000]):
        return "utf-16-be" if zeros[0] > zeros[1] else "utf-16-le"
    try:
        data.decode("utf-8")
        return "utf-8"
    except UnicodeDecodeError:
        return _legacy_encoding(data, source, ask)


def _legacy_encoding(data: bytes, source: str, ask: Ask | None) -> str:
    """GBK writes high bytes in pairs; Western text has single ones, as in the degree sign or an umlaut."""
    _refuse_signs(data.decode("latin-1"), source)
    odd = [len(run) % 2 == 1 for run in re.findall(rb"[\x80-\xff]+", data)]
    if not any(odd) and _decodes(data, "gb18030"):
        return "gb18030"
    if all(odd) and _decodes(data, "cp1252"):
        return "cp1252"
    return answer("which encoding is it?", ("gb18030", "cp1252", "utf-8"), ask, source, "encoding")


def _decodes(data: bytes, encoding: str) -> bool:
    try:
        data.decode(encoding)
    except UnicodeDecodeError:
        return False
    return True
