#!/usr/bin/env python3
"""Adds up what gcov says of the core (tools/coverage.sh runs it).

    tools/coverage.py BUILD EXCEPTIONS [--lines]

A line counts as executed if any program has executed it, in any instantiation of its template. A branch is one way out
of a condition; of a template's instantiations that one counts which was seen most of. Edges of exceptions do not count:
the core is built without. EXCEPTIONS: lines `FILE: REGEX  # why`; the regex is searched in the line's text.
"""

import concurrent.futures
import gzip
import json
import os
import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
GOALS = (98.0, 90.0)


def report_of(data, build):
    """The lines of the core in one object: {file: [(line, function, count, [branch counts])]}."""
    out = subprocess.run(["gcov", "--json-format", "--stdout", "--branch-probabilities", data.name], cwd=data.parent,
                         capture_output=True, check=True).stdout
    if out[:2] == b"\x1f\x8b":
        out = gzip.decompress(out)
    found = {}
    for text in out.splitlines():
        if not text.strip():
            continue
        for file in json.loads(text)["files"]:
            path = os.path.normpath(os.path.join(build, file["file"]))  # Ninja compiles there; ccache may make it relative
            name = os.path.relpath(path, ROOT)
            if not name.startswith("core/"):
                continue
            found.setdefault(name, []).extend(
                (line["line_number"], line.get("function_name", ""), line["count"],
                 [b["count"] for b in line["branches"] if not b["throw"]]) for line in file["lines"])
    return found


def main():
    build, exceptions = Path(sys.argv[1]).resolve(), Path(sys.argv[2])
    show = "--lines" in sys.argv[3:]
    data = sorted(build.rglob("*.gcda"))
    if not data:
        raise SystemExit(f"coverage: no counts below {build}")
    lines = defaultdict(lambda: defaultdict(int))
    branches = defaultdict(lambda: defaultdict(dict))  # file, line, function: counts
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count() or 2) as pool:
        for report in pool.map(report_of, data, [build] * len(data)):
            for name, entries in report.items():
                for number, function, count, ways in entries:
                    lines[name][number] += count
                    if ways:
                        old = branches[name][number].get(function, [0] * len(ways))
                        if len(old) < len(ways):
                            old += [0] * (len(ways) - len(old))
                        branches[name][number][function] = [a + b for a, b in zip(old, ways + [0] * (len(old) - len(ways)))]

    if not lines:
        raise SystemExit(f"coverage: no line of core/ in what {build} has counted")
    excuses = []
    for number, text in enumerate(exceptions.read_text().splitlines(), 1):
        if not text.strip() or text.startswith("#"):
            continue
        match = re.fullmatch(r"(\S+): (.+?)  # (.+)", text)
        if not match:
            raise SystemExit(f"{exceptions}:{number}: expected 'FILE: REGEX  # why'")
        excuses.append([match[1], re.compile(match[2]), match[3], 0, number])

    total = [0, 0, 0, 0]
    unexcused = []
    excused = []
    for name in sorted(lines):
        text = (ROOT / name).read_text().split("\n")
        hit = sum(1 for count in lines[name].values() if count)
        seen = ways = 0
        for functions in branches[name].values():
            counts = max(functions.values(), key=lambda c: (sum(map(bool, c)) / len(c), len(c)))
            seen += sum(map(bool, counts))
            ways += len(counts)
        total = [t + n for t, n in zip(total, (hit, len(lines[name]), seen, ways))]
        print(f"{name:52} lines {hit:4} of {len(lines[name]):4}   branches {seen:4} of {ways:4}")
        for number, count in sorted(lines[name].items()):
            if count:
                continue
            line = text[number - 1].strip()
            for excuse in excuses:
                if excuse[0] == name and excuse[1].search(line):
                    excuse[3] += 1
                    excused.append(f"{name}:{number}: {line}   ({excuse[2]})")
                    break
            else:
                unexcused.append(f"{name}:{number}: {line}")
    percent = [100.0 * total[0] / total[1], 100.0 * total[2] / total[3]]
    if show:
        print("\nnot executed, excused:", *excused, sep="\n  ")
    problems = 0
    if unexcused:
        problems += 1
        print(f"\nnot executed, and no excuse in {exceptions}:", *unexcused, sep="\n  ")
    for name, regex, _, used, number in excuses:
        if not used:
            problems += 1
            print(f"{exceptions}:{number}: fits no line that was not executed: {name}: {regex.pattern}")
    for what, is_, goal in zip(("lines", "branches"), percent, GOALS):
        if is_ < goal:
            problems += 1
            print(f"{is_:.2f} % of the {what}: the goal is {goal:g} %")
    print(f"\ncore: {percent[0]:.2f} % of {total[1]} lines, {percent[1]:.2f} % of {total[3]} branches, "
          f"{len(excused)} lines excused, {len(unexcused)} not")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
