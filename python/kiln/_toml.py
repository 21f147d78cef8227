"""Values of Python as TOML, the language of scene files and of inline cameras."""

import json
import os


def value(given) -> str:
    """A value in one line. Arrays of numpy are lists."""
    if hasattr(given, "tolist"):
        given = given.tolist()
    if isinstance(given, bool):
        return "true" if given else "false"
    if isinstance(given, (int, float)):
        return repr(given)
    if isinstance(given, (str, os.PathLike)):
        # A string of JSON is one of TOML, but for DEL.
        return json.dumps(os.fspath(given), ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(given, dict):
        return "{ " + ", ".join(f"{value(str(key))} = {value(item)}" for key, item in given.items()) + " }"
    if isinstance(given, (list, tuple)):
        return "[" + ", ".join(map(value, given)) + "]"
    raise TypeError(f"a scene has no place for a value of the type {type(given).__name__}")


def document(table: dict) -> str:
    """A table as a document, an entry a line."""
    return "".join(f"{value(str(key))} = {value(item)}\n" for key, item in table.items())
