#!/usr/bin/env python3
"""The rules of the source tree that no compiler checks.

    tools/policy.py              checks the tree that it stands in
    tools/policy.py --root DIR   checks another
    tools/policy.py --self-test  seeds one violation of each rule and fails unless each is found

Rules: who may include whom; which standard headers the core may use; no clock in the core; #pragma once; words and
paths that do not belong into a published file. Each finding is one line, "file:line: rule: what".
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

# Who may include whom. A zone is a part of the tree; "std" is any header in angle brackets.
CORE = {"base", "protocol", "motion", "sync", "bus"}
ALLOWED = {
    "base": {"base"},
    "protocol": {"base", "protocol"},
    "sync": {"base", "sync"},
    "motion": {"base", "protocol", "motion"},  # a Sample is made from a Reply
    "bus": {"base", "protocol", "sync", "motion", "bus"},
    "umbrella": CORE | {"umbrella"},
    "c": CORE | {"c"},  # the C interface: a view of the core that nothing below knows
    "design": {"base", "motion", "design"},  # solves what motion's estimators use; nothing below knows it
    "posix": {"posix"},  # descriptors and files
    "sim": CORE | {"sim", "posix"},
    "mcu": CORE | {"mcu"},
    "linux": CORE | {"linux", "mcu", "posix"},  # mcu: the register drivers, for memory-mapped UARTs (docs/adr/0012)
    "user": CORE | {"umbrella", "c", "design", "sim", "mcu", "linux", "posix", "user"},
}

# The folders of the zones, the first match counts. A source in core/src itself has the zone of the header that it
# has the name of.
ZONES = [
    ("core/include/tm485/tm485.hpp", "umbrella"),
    ("core/include/tm485/protocol/", "protocol"),
    ("core/include/tm485/motion/", "motion"),
    ("core/include/tm485/sync/", "sync"),
    ("core/include/tm485/bus/", "bus"),
    ("core/include/tm485/", "base"),
    ("core/src/protocol/", "protocol"),
    ("core/src/motion/", "motion"),
    ("core/src/sync/", "sync"),
    ("core/src/bus/", "bus"),
    ("core/c/", "c"),
    ("core/design/", "design"),
    ("hal/posix/", "posix"),
    ("hal/sim/", "sim"),
    ("hal/mcu/", "mcu"),
    ("hal/linux/", "linux"),
    ("tools/", "user"),
    ("tests/", "user"),
    ("bench/", "user"),
    ("docs/", "user"),
    ("integrations/", "user"),
]

INCLUDE_FOLDERS = ["core/include", "core/c/include", "core/design/include", "hal/posix/include", "hal/sim/include", "hal/mcu/include", "hal/linux/include"]

# The simulated encoder and its line judge the codecs, so they share nothing with them, not even indirectly. So do the
# models of UARTs and the register drivers.
JUDGES = re.compile(r"^hal/sim/.*/(encoder_model|line|motion_profile)[^/]*\.(hpp|cpp)$")
JUDGES_MAY = re.compile(r"^(core/include/tm485/time\.hpp|hal/sim/include/tm485/sim/[^/]+\.hpp)$")

UART_MODELS = re.compile(r"^tests/mcu/(models|line)/[^/]*\.(hpp|cpp)$")

CORE_STD = set(
    "algorithm array atomic bit chrono compare concepts cstddef cstdint cstring expected initializer_list limits "
    "numbers numeric optional ratio span string_view tuple type_traits utility variant".split()
)

# The C interface besides: what C has of it, and placement new.
C_STD = CORE_STD | {"new", "stdbool.h", "stddef.h", "stdint.h"}

CLOCK = re.compile(r"\b(steady|system|high_resolution)_clock\b")

# Written in pieces, so that this file keeps its own rule.
WORDS = [
    (re.compile(r"\b(" + "|".join(["TO" + "DO", "FIX" + "ME", "X" + "XX", "HA" + "CK"]) + r")\b"), "unfinished"),
    (re.compile(r"\b" + "st" + r"ubs?\b", re.IGNORECASE), "unfinished"),
    (re.compile(r"\b" + "place" + r"holders?\b", re.IGNORECASE), "unfinished"),
    (re.compile(r"(?<![\w.])/(" + "work|ro" + r"ot|home/\w+)/"), "machine path"),
    (re.compile(r"/tmp/" + r"bash"), "machine path"),
    (
        re.compile(
            "|".join(
                re.escape(first + second)
                for first, second in [
                    ("deb.deb", "ian.org"),
                    ("security.deb", "ian.org"),
                    ("registry.np", "mjs"),
                    ("py", "pi.org"),
                    ("files.python", "hosted"),
                    ("proxy.go", "lang.org"),
                    ("crates", ".io"),
                ]
            )
        ),
        "registry host",
    ),
]

CPP = {".hpp", ".h", ".cpp", ".c", ".cc"}
INCLUDE = re.compile(r'^\s*#\s*include\s*(?:<([^>]+)>|"([^"]+)")')


def tracked_files(root):
    """The files that are, or are about to be, in the repository."""
    git = ["git", "-C", str(root), "-c", f"safe.directory={root}", "ls-files", "-z"]
    try:
        out = subprocess.run(
            git + ["--cached", "--others", "--exclude-standard"], capture_output=True, check=True
        ).stdout
        names = [name for name in out.decode().split("\0") if name]
    except (OSError, subprocess.CalledProcessError):
        names = []
        for folder, folders, files in os.walk(root):
            folders[:] = [f for f in folders if f not in (".git", "build", "__pycache__")]
            names += [str((Path(folder) / f).relative_to(root)) for f in files]
    return sorted(name for name in set(names) if (root / name).is_file())


class Tree:
    """The files of a tree, their zones and their includes."""

    def __init__(self, root):
        self.root = root
        self.files = tracked_files(root)
        self.names = set(self.files)
        self.text = {}
        for name in self.files:
            try:
                self.text[name] = (root / name).read_text(encoding="utf-8").splitlines()
            except UnicodeDecodeError:
                pass  # a binary file has no lines to check
        self.sources = [name for name in self.text if Path(name).suffix in CPP]
        self.includes = {name: list(self.find_includes(name)) for name in self.sources}

    def find_includes(self, name):
        """(line number, spelling, file in the tree or None) of each include."""
        for number, line in enumerate(self.text[name], 1):
            match = INCLUDE.match(line)
            if match:
                spelling = match.group(1) or match.group(2)
                places = [os.path.normpath(os.path.join(folder, spelling)) for folder in INCLUDE_FOLDERS]
                if match.group(2):
                    places.insert(0, os.path.normpath(os.path.join(os.path.dirname(name), spelling)))
                    places += [os.path.join(f, spelling) for f in ("tools/tm485", "tests", "core/c/src", "hal/sim/src", "hal/linux/src")]
                yield number, spelling, next((p for p in places if p in self.names), None)

    def zone(self, name):
        for prefix, zone in ZONES:
            if name.startswith(prefix):
                return zone
        if re.match(r"core/src/[^/]+$", name):
            stem = Path(name).stem
            for other in self.files:
                if other.startswith("core/include/") and Path(other).stem == stem:
                    return self.zone(other)
        return None


def check_layers(tree):
    for name in tree.sources:
        zone = tree.zone(name)
        if zone is None:
            yield name, 1, "layer", "belongs to no part of the tree that policy.py knows"
            continue
        for number, spelling, target in tree.includes[name]:
            if target is None:
                if spelling.startswith("tm485/"):
                    yield name, number, "layer", f'"{spelling}" is not in the tree'
                continue
            other = tree.zone(target)
            if other not in ALLOWED[zone]:
                yield name, number, "layer", f"{zone} must not include {other} ({spelling})"


def check_judges(tree):
    for name in tree.sources:
        if UART_MODELS.match(name):
            for number, spelling, target in tree.includes[name]:
                if target is not None and tree.zone(target) == "mcu":
                    yield name, number, "judge", f"shares code with what it judges: {spelling}"
        if not JUDGES.match(name):
            continue
        seen, waiting = {name}, [(name, [])]
        while waiting:
            current, path = waiting.pop()
            for number, spelling, target in tree.includes.get(current, []):
                if target is None or target in seen:
                    continue
                seen.add(target)
                if JUDGES_MAY.match(target) or target.startswith("hal/sim/src/"):
                    waiting.append((target, path + [spelling]))
                else:
                    way = " -> ".join(path + [spelling])
                    line = number if current == name else 1
                    yield name, line, "judge", f"shares code with what it judges: {way}"


def runs_on_microcontrollers(tree, name):
    # core/design is a library of its own, for hosts: it may use all of the standard library, and Eigen.
    return name.startswith(("core/", "hal/mcu/")) and tree.zone(name) != "design"


def check_core_headers(tree):
    for name in tree.sources:
        if runs_on_microcontrollers(tree, name):
            for number, spelling, target in tree.includes[name]:
                allowed = C_STD if tree.zone(name) == "c" else CORE_STD
                if target is None and spelling not in allowed and not spelling.startswith("tm485/"):
                    yield name, number, "core-header", f"<{spelling}> is not among the headers that the core may use"


def check_clock(tree):
    for name in tree.sources:
        if name.startswith(("core/", "hal/mcu/")):
            for number, line in enumerate(tree.text[name], 1):
                match = CLOCK.search(line)
                if match:
                    yield name, number, "clock", f"the core reads no clock ({match.group(0)})"


def check_once(tree):
    for name in tree.sources:
        if Path(name).suffix in (".hpp", ".h") and "#pragma once" not in tree.text[name]:
            yield name, 1, "once", "a header without #pragma once"


def check_words(tree):
    for name, lines in tree.text.items():
        for number, line in enumerate(lines, 1):
            for pattern, what in WORDS:
                match = pattern.search(line)
                if match:
                    yield name, number, "word", f"{what}: {match.group(0)}"


CHECKS = [check_layers, check_judges, check_core_headers, check_clock, check_once, check_words]


def findings(root):
    tree = Tree(root)
    return [finding for check in CHECKS for finding in check(tree)], len(tree.files)


# One violation a line: file, line of text, rule that must find it, part of the message.
SEEDS = [
    ("core/include/tm485/protocol/a.hpp", '#include "tm485/bus/b.hpp"', "layer", "protocol must not include bus"),
    ("core/include/tm485/protocol/a.hpp", '#include "tm485/motion/m.hpp"', "layer", "protocol must not include motion"),
    ("core/include/tm485/motion/a.hpp", '#include "tm485/bus/b.hpp"', "layer", "motion must not include bus"),
    ("core/include/tm485/motion/a.hpp", "#include <tm485/sync/s.hpp>", "layer", "motion must not include sync"),
    ("core/include/tm485/sync/a.hpp", '#include "tm485/protocol/p.hpp"', "layer", "sync must not include protocol"),
    ("core/include/tm485/base.hpp", '#include "tm485/protocol/p.hpp"', "layer", "base must not include protocol"),
    ("core/src/p.cpp", '#include "tm485/bus/b.hpp"', "layer", "protocol must not include bus"),
    ("core/src/nothing.cpp", "int x;", "layer", "no part of the tree"),
    ("core/include/tm485/bus/a.hpp", '#include "tm485/sim/line.hpp"', "layer", "bus must not include sim"),
    ("core/include/tm485/bus/a.hpp", '#include "tm485/linux/l.hpp"', "layer", "bus must not include linux"),
    ("core/include/tm485/bus/a.hpp", '#include "tm485/gone.hpp"', "layer", "not in the tree"),
    ("core/include/tm485/motion/a.hpp", '#include "tm485/design/d.hpp"', "layer", "motion must not include design"),
    ("core/design/src/a.cpp", '#include "tm485/bus/b.hpp"', "layer", "design must not include bus"),
    ("core/include/tm485/bus/a.hpp", '#include "tm485/c/c.h"', "layer", "bus must not include c"),
    ("core/c/src/a.cpp", '#include "tm485/sim/line.hpp"', "layer", "c must not include sim"),
    ("core/c/src/a.cpp", "#include <stdio.h>", "core-header", "<stdio.h>"),
    ("core/c/include/tm485/c/a.h", None, "once", "without #pragma once"),
    ("core/include/tm485/motion/a.hpp", "#include <Eigen/Dense>", "core-header", "<Eigen/Dense>"),
    ("hal/linux/src/a.cpp", '#include "tm485/sim/line.hpp"', "layer", "linux must not include sim"),
    ("hal/posix/src/a.cpp", '#include "tm485/linux/l.hpp"', "layer", "posix must not include linux"),
    ("hal/posix/src/a.cpp", '#include "tm485/time.hpp"', "layer", "posix must not include base"),
    ("hal/sim/src/a.cpp", '#include "tm485/linux/l.hpp"', "layer", "sim must not include linux"),
    ("hal/sim/src/a.cpp", '#include "tm485/mcu/u.hpp"', "layer", "sim must not include mcu"),
    ("hal/mcu/include/tm485/mcu/a.hpp", '#include "tm485/linux/l.hpp"', "layer", "mcu must not include linux"),
    ("hal/mcu/include/tm485/mcu/a.hpp", '#include "tm485/sim/line.hpp"', "layer", "mcu must not include sim"),
    ("hal/mcu/include/tm485/mcu/a.hpp", "#include <string>", "core-header", "<string>"),
    ("core/include/tm485/bus/a.hpp", '#include "tm485/mcu/u.hpp"', "layer", "bus must not include mcu"),
    ("tests/mcu/models/a.hpp", '#include "tm485/mcu/u.hpp"', "judge", "shares code"),
    ("hal/sim/src/a.cpp", '#include "../../../tools/tm485/t.hpp"', "layer", "sim must not include user"),
    ("hal/sim/src/encoder_model.cpp", '#include "tm485/protocol/p.hpp"', "judge", "shares code"),
    ("hal/sim/src/line_faults.cpp", '#include "tm485/errc.hpp"', "judge", "shares code"),
    ("hal/sim/src/motion_profile.cpp", '#include "tm485/sim/port.hpp"', "judge", "port.hpp -> tm485/bus/b.hpp"),
    ("core/src/p.cpp", "#include <vector>", "core-header", "<vector>"),
    ("core/include/tm485/sync/a.hpp", "#include <mutex>", "core-header", "<mutex>"),
    ("core/src/p.cpp", "auto t = std::chrono::steady" + "_clock::now();", "clock", "no clock"),
    ("core/include/tm485/sync/a.hpp", None, "once", "without #pragma once"),
    ("docs/a.md", "TO" + "DO: later", "word", "unfinished"),
    ("tools/tm485/a.cpp", "// FIX" + "ME", "word", "unfinished"),
    ("tools/tm485/a.cpp", "// a st" + "ub of it", "word", "unfinished"),
    ("tools/a.sh", "cd /wo" + "rk/main", "word", "machine path"),
    ("tools/a.sh", 'cat "/ro' + 'ot/x"', "word", "machine path"),
    ("tools/a.sh", "curl http://deb.deb" + "ian.org/", "word", "registry host"),
]

# A small tree that keeps every rule; the includes of the seeds exist in it.
CLEAN = {
    "core/include/tm485/time.hpp": "#include <chrono>",
    "core/include/tm485/errc.hpp": "#include <cstdint>",
    "core/include/tm485/protocol/p.hpp": '#include "tm485/errc.hpp"',
    "core/include/tm485/motion/m.hpp": '#include "tm485/protocol/p.hpp"',
    "core/include/tm485/sync/s.hpp": "#include <atomic>",
    "core/include/tm485/bus/b.hpp": '#include "tm485/motion/m.hpp"\n#include "tm485/sync/s.hpp"',
    "core/src/p.cpp": '#include "tm485/protocol/p.hpp"',
    "core/c/include/tm485/c/c.h": "#pragma once\n#include <stdint.h>",
    "core/c/src/c.cpp": '#include "tm485/c/c.h"\n#include "tm485/bus/b.hpp"\n#include <new>',
    "core/design/include/tm485/design/d.hpp": '#include "tm485/motion/m.hpp"\n#include <complex>',
    "core/design/src/d.cpp": '#include "tm485/design/d.hpp"\n#include <Eigen/Dense>',
    "hal/sim/include/tm485/sim/line.hpp": '#include "tm485/time.hpp"\n#include <vector>',
    "hal/sim/include/tm485/sim/port.hpp": '#include "tm485/bus/b.hpp"',
    "hal/sim/src/encoder_model.cpp": '#include "tm485/sim/line.hpp"',
    "hal/mcu/include/tm485/mcu/u.hpp": '#include "tm485/bus/b.hpp"\n#include <array>',
    "hal/linux/include/tm485/linux/l.hpp": '#include "tm485/bus/b.hpp"\n#include "tm485/mcu/u.hpp"\n#include <string>',
    "tools/tm485/t.hpp": '#include "tm485/linux/l.hpp"\n#include "tm485/sim/port.hpp"',
    "tools/tm485/t.cpp": '#include "t.hpp"',
    "docs/a.md": "a stubborn text of works/ and a root",
}


def write(root, name, text):
    path = root / name
    path.parent.mkdir(parents=True, exist_ok=True)
    once = "#pragma once\n" if path.suffix == ".hpp" and text is not None else ""
    path.write_text(once + (text or "") + "\n", encoding="utf-8")


def self_test():
    failures = []
    with tempfile.TemporaryDirectory() as folder:
        for number, seed in enumerate([None] + SEEDS):
            root = Path(folder) / str(number)
            for name, text in CLEAN.items():
                write(root, name, text)
            if seed is not None:
                name, text, rule, part = seed
                write(root, name, text)
            found, _ = findings(root)
            if seed is None:
                failures += [f"clean tree: {finding}" for finding in found]
            elif not any(f[0] == name and f[2] == rule and part in f[3] for f in found):
                failures.append(f"not found: {name}: {text!r} by rule {rule}; found {found}")
    for failure in failures:
        print(failure)
    print(f"policy self-test: {len(SEEDS)} seeded violations, {len(failures)} problems")
    return 1 if failures else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parent.parent)
    parser.add_argument("--self-test", action="store_true")
    arguments = parser.parse_args()
    if arguments.self_test:
        return self_test()
    found, count = findings(arguments.root.resolve())
    for name, number, rule, what in found:
        print(f"{name}:{number}: {rule}: {what}")
    print(f"policy: {count} files, {len(found)} findings")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
