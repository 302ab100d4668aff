"""Compares JSON documents of the program with docs/schemas, for tests/job/schemas.rs.

Arguments: the folder of the schemas, and one of documents. The document check-copc.json belongs to check.schema.json. Every field must
have a description, every object must list its fields, every document must fit its schema and would not fit it with one field more, and
every field must be in a document.
"""

import copy
import json
import sys
from pathlib import Path

from jsonschema import Draft202012Validator


def schemas_in(schema, at="#"):
    """Yields a schema and all schemas within it, each with its place."""
    yield at, schema
    for key in ("properties", "patternProperties", "$defs"):
        for name, inner in schema.get(key, {}).items():
            yield from schemas_in(inner, f"{at}/{key}/{name}")
    for key in ("anyOf", "oneOf", "prefixItems"):
        for number, inner in enumerate(schema.get(key, [])):
            yield from schemas_in(inner, f"{at}/{key}/{number}")
    if isinstance(schema.get("items"), dict):
        yield from schemas_in(schema["items"], f"{at}/items")


def fields_of(schema):
    """Returns the places of all fields, each of which must have a description."""
    fields = set()
    for at, inner in schemas_in(schema):
        if inner.get("type") == "object":
            assert inner.get("additionalProperties") is False, f"{at} lets any field in"
        for key in ("properties", "patternProperties"):
            for name, field in inner.get(key, {}).items():
                assert field.get("description"), f"{at}: {name} has no description"
                fields.add(f"{at}/{key}/{name}")
    return fields


def fields_in(document, schema, at, root):
    """Yields the places of the fields of a schema that a document has."""
    if "$ref" in schema:
        name = schema["$ref"].removeprefix("#/$defs/")
        yield from fields_in(document, root["$defs"][name], f"#/$defs/{name}", root)
    for number, inner in enumerate(schema.get("anyOf", [])):
        yield from fields_in(document, inner, f"{at}/anyOf/{number}", root)
    if isinstance(document, dict):
        for key in ("properties", "patternProperties"):
            for name, field in schema.get(key, {}).items():
                values = document.values() if key == "patternProperties" else [document[name]] if name in document else []
                for value in values:
                    yield f"{at}/{key}/{name}"
                    yield from fields_in(value, field, f"{at}/{key}/{name}", root)
    if isinstance(document, list):
        first = schema.get("prefixItems", [])
        for number, (value, inner) in enumerate(zip(document, first)):
            yield from fields_in(value, inner, f"{at}/prefixItems/{number}", root)
        if isinstance(schema.get("items"), dict):
            for value in document[len(first) :]:
                yield from fields_in(value, schema["items"], f"{at}/items", root)


def objects_in(document):
    """Yields all objects within a document."""
    if isinstance(document, dict):
        yield document
    values = document.values() if isinstance(document, dict) else document if isinstance(document, list) else []
    for value in values:
        yield from objects_in(value)


def check_document(name, document, validator):
    """Asserts that a document fits, and that no object in it may have one field more."""
    for error in validator.iter_errors(document):
        raise AssertionError(f"{name}: {error.json_path}: {error.message}")
    for number in range(sum(1 for _ in objects_in(document))):
        larger = copy.deepcopy(document)
        next(inner for at, inner in enumerate(objects_in(larger)) if at == number)["new_field"] = 1
        assert not validator.is_valid(larger), f"{name}: the schema lets a new field into {list(objects_in(document))[number]}"


def main(schemas, documents):
    checked = 0
    for path in sorted(schemas.glob("*.schema.json")):
        schema = json.loads(path.read_text())
        Draft202012Validator.check_schema(schema)
        validator, missing = Draft202012Validator(schema), fields_of(schema)
        for file in sorted(documents.glob(f"{path.name.split('.')[0]}-*.json")):
            document = json.loads(file.read_text())
            check_document(file.name, document, validator)
            missing -= set(fields_in(document, schema, "#", schema))
            checked += 1
        assert not missing, f"{path.name}: no document has {sorted(missing)}"
    print(f"{checked} documents fit")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
