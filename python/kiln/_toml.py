"""Values of Python as TOML, the language of scene files and of inline cameras."""

import json
import os
from collections.abc import Mapping
from typing import Any


def unicode(text: str, name: str) -> str:
    """A text that can be encoded; `name` is for the error."""
    try:
        text.encode()
    except UnicodeEncodeError:
        raise ValueError(f"{name}: {ascii(text)} has surrogates, which are not text") from None
    return text


def value(given: Any, key: str = "") -> str:
    """A value in one line; `key` is for errors. Arrays of numpy become lists; tables leave out entries of None."""
    if hasattr(given, "tolist"):
        given = given.tolist()
    if isinstance(given, bool):
        return "true" if given else "false"
    if isinstance(given, (int, float)):
        return repr(given)
    if isinstance(given, (str, os.PathLike)):
        # A string of JSON is one of TOML, but for DEL.
        return json.dumps(unicode(os.fspath(given), key), ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(given, Mapping):
        return "{ " + ", ".join(_entries(given, f"{key}." if key else "")) + " }"
    if isinstance(given, (list, tuple)):
        return "[" + ", ".join(value(item, key) for item in given) + "]"
    raise TypeError(f"unsupported type {type(given).__name__} for key `{key}`")


def _entries(table: Mapping[Any, Any], prefix: str = "") -> list[str]:
    entries = [(str(key), item) for key, item in table.items() if item is not None]
    return [f"{value(key, 'key')} = {value(item, prefix + key)}" for key, item in entries]


def document(table: Mapping[Any, Any]) -> str:
    """A table as a document, an entry a line."""
    return "".join(f"{entry}\n" for entry in _entries(table))
