#!/usr/bin/env python3
"""The golden vectors (tests/vectors/*.json) as a C++ array, for integrations/firmware/vectors: called by its build.

    tools/firmware/vectors.py OUT.hpp FILE.json..."""

import json
import sys
from pathlib import Path

REQUEST_LENGTHS = {0x32: 4, 0xEA: 3}  # EEPROM write and read, by CF; all others are one byte
FIELDS = ("sf", "abs", "abm", "enid", "almc", "adf", "edf")


def number(value):
    return int(value, 16) if isinstance(value, str) else int(value)


def kind_of(vector, data):
    if vector.get("direction") != "host->encoder" and vector["decoded"].get("direction") != "request":
        return "reply"
    # Some of the document's lines are the CF alone of a request that has more bytes.
    whole = len(data) == REQUEST_LENGTHS.get(data[0], 1) or vector["kind"] in ("negative", "erratum")
    return "request" if whole else "control_field"


def row(vector, index, source):
    data = bytes.fromhex(vector["hex"])
    decoded = vector["decoded"]
    known = [(name, number(decoded[name])) for name in FIELDS if name in decoded]
    fields = ", ".join(f"{{Field::{name}, {value}}}" for name, value in known)
    return (
        f'    {{"{vector.get("id", f"{source}-{index}")}", Kind::{kind_of(vector, data)}, '
        f"{{{', '.join(f'0x{byte:02X}' for byte in data)}}}, {len(data)}, "
        f'"{decoded.get("expect", "ok")}", {{{fields}}}, {len(known)}}},'
    )


def main():
    out, *files = sys.argv[1:]
    rows = []
    for name in files:
        vectors = json.loads(Path(name).read_text())["vectors"]
        rows += [row(vector, index, Path(name).stem) for index, vector in enumerate(vectors)]
    Path(out).write_text(
        "// Made from tests/vectors by tools/firmware/vectors.py.\n#pragma once\n\n#include \"vector.hpp\"\n\n"
        f"inline constexpr Vector kVectors[{len(rows)}] = {{\n" + "\n".join(rows) + "\n};\n"
    )


if __name__ == "__main__":
    main()
