"""Checks a program's JSON schema of its configuration: check_schema.py SCHEMA BASE PROGRAM-COMMAND... -- FILE...

Every FILE (TOML; a folder stands for those in it) must satisfy the schema. Then each key is given each kind of wrong value (wrong
type, below and above its range, an unknown word, a list of wrong length), and each table an unknown key: schema and
program must both refuse it. BASE is TOML to which the key is added, and the program reads the file as the last argument
of its command.
"""

import copy
import json
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any, Iterator

import jsonschema

Document = dict[str, Any]


def toml_of(value: Any) -> str:
    """A value as TOML on one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, list):
        return "[" + ", ".join(map(toml_of, value)) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml_of(item)}" for key, item in value.items()) + "}"
    return repr(value)


def wrong_values(schema: Document) -> Iterator[Any]:
    """Values that a key with this schema must not take."""
    if "anyOf" in schema:
        yield [True]
    elif "enum" in schema:
        yield "no-such-word"
        yield 1
    elif schema["type"] in ("number", "integer"):
        yield "text"
        yield schema["minimum"] - 1
        yield 2 * abs(schema["maximum"]) + 1
        if schema["type"] == "integer":
            yield 0.5
    elif schema["type"] == "array":
        yield 1.0
        yield ["text"] * schema.get("minItems", 1)
        if "maxItems" in schema:
            yield [0.0] * (schema["maxItems"] + 1)
    else:
        yield [1]


def tables_of(schema: Document, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Document]]:
    """Every table of a schema with its path; a list of tables has the name of its list."""
    yield path, schema
    for name, entry in schema["properties"].items():
        table = entry.get("items", entry)
        if table.get("type") == "object":
            yield from tables_of(table, (*path, name))


def with_key(base: Document, schema: Document, path: tuple[str, ...], key: str, value: Any) -> Document:
    """A copy of a document with a key in a table, which is made if it is missing."""
    document = copy.deepcopy(base)
    table = document
    for name in path:
        entry = schema["properties"][name]
        repeated = "items" in entry
        schema = entry["items"] if repeated else entry
        new = {required: [0.0, 0.0, 0.0] for required in schema.get("required", [])}
        if repeated:
            table.setdefault(name, [new])
            table = table[name][0]
        else:
            table = table.setdefault(name, new)
    table[key] = value
    return document


def files_of(names: list[str]) -> list[Path]:
    files = []
    for path in map(Path, names):
        found = sorted(path.glob("*.toml")) if path.is_dir() else [path]
        if not found:
            raise SystemExit(f"error: {path} has no TOML file")
        files += found
    return files


class Check:
    def __init__(self, schema: Document, command: list[str], folder: Path) -> None:
        self.validator = jsonschema.Draft7Validator(schema)
        self.command = command
        self.file = folder / "given.toml"
        self.failures = 0

    def fail(self, problem: str) -> None:
        self.failures += 1
        print(f"error: {problem}", file=sys.stderr)

    def program_accepts(self, document: Document) -> bool:
        self.file.write_text("".join(f"{key} = {toml_of(value)}\n" for key, value in document.items()))
        result = subprocess.run([*self.command, self.file], capture_output=True, text=True)
        return str(self.file) not in result.stderr  # its messages name file and line

    def refused_by_both(self, document: Document, what: str) -> None:
        if self.validator.is_valid(document):
            self.fail(f"the schema accepts {what}")
        if self.program_accepts(document):
            self.fail(f"the program accepts {what}")


def main() -> int:
    separator = sys.argv.index("--")
    schema_file, base_text, *command = sys.argv[1:separator]
    schema = json.loads(Path(schema_file).read_text())
    jsonschema.Draft7Validator.check_schema(schema)
    base = tomllib.loads(base_text)
    with tempfile.TemporaryDirectory() as folder:
        check = Check(schema, command, Path(folder))
        if not check.program_accepts(base):
            check.fail("the program refuses the base document")
        for file in files_of(sys.argv[separator + 1 :]):
            for error in check.validator.iter_errors(tomllib.loads(file.read_text())):
                check.fail(f"the schema refuses {file}: {error.json_path}: {error.message}")
        tried = 0
        for path, table in tables_of(schema):
            check.refused_by_both(with_key(base, schema, path, "no_such_key", 1), ".".join((*path, "no_such_key")))
            for key, entry in table["properties"].items():
                if entry.get("type") == "object" or "properties" in entry.get("items", {}):
                    continue
                for value in wrong_values(entry):
                    tried += 1
                    check.refused_by_both(with_key(base, schema, path, key, value), f"{'.'.join((*path, key))} = {value}")
    print(f"{tried} wrong values were tried")
    return 1 if check.failures or not tried else 0


if __name__ == "__main__":
    sys.exit(main())
