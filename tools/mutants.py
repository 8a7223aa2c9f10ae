#!/usr/bin/env python3
"""Breaks the core on purpose, one small change at a time, and looks whether a test notices.

    tools/mutants.py [--count N] [--seed S] [--jobs J] [--minutes M]   N mutants chosen by S (an integer or any text)
    tools/mutants.py --list [--count N] [--seed S]                     shows them, builds nothing
    tools/mutants.py --only FILE:LINE                                  those of one line

A mutant is one of: an operator swapped (< <= == && + & << ...), a constant one more or less, a statement removed, a
condition negated, true for false. It is killed if a test fails or runs for too long, or if a static_assert refuses it;
one that does not compile for another reason is no mutant, and the next is taken. Each is first given to the tests that
belong to its file, and, if they see nothing, to all of tests/core, tests/integration, tests/sync and tests/c.

Works on a copy of the last commit in build/mutants; the tree is not touched. The last line is
"N mutants, N killed, N survived". Exit code 1 if fewer than 95 in 100 are killed, with up to 20 mutants if more than
one survives.
"""

import argparse
import concurrent.futures
import hashlib
import os
import random
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
WORK = ROOT / "build" / "mutants"
TREE = WORK / "tree"
MUTATED = ["core/src", "core/include"]
# Texts and numbers that no test can know better.
NOT_MUTATED = re.compile(r"core/src/(errc|version)\.cpp|version\.h(pp)?$|sync/atomics\.hpp")
INCLUDES = ["core/include", "core/c/include", "core/c/src", "core/design/include", "hal/sim/include", "tests"]
FLAGS = ["-std=c++23", "-O1", "-D_GLIBCXX_ASSERTIONS", "-w", f'-DTM485_TEST_VECTORS="{TREE}/tests/vectors"']
# What is linked with every test: the core, its C interface, the simulated encoder.
LIBRARY = ["core/src/*.cpp", "core/c/src/*.cpp", "hal/sim/src/*.cpp"]
LIBRARY_NOT = re.compile(r"hal/sim/src/(server|endpoint|eeprom_file)\.cpp")
BUILD_SECONDS = 300
RUN_SECONDS = 120

# The tests of a file, by its stem; otherwise those that have its name. Further ones come if these see nothing.
FIRST = {
    "layout": ["core/frame_test", "core/request_test"],
    "frame": ["core/frame_test", "core/frame_faults_test"],
    "crc": ["core/crc_test", "core/frame_test"],
    "profile": ["core/profile_test", "core/frame_test"],
    "profile_compile": ["core/profile_test", "core/frame_test"],
    "bus": ["core/bus_test", "core/bus_accounts_test"],
    "bus_poll": ["core/bus_test", "core/bus_accounts_test", "core/bus_limits_test"],
    "bus_reply": ["core/bus_test", "core/bus_accounts_test", "core/bus_limits_test"],
    "bus_states": ["core/bus_test", "core/bus_accounts_test", "core/bus_limits_test"],
    "axis": ["core/axis_test", "core/axis_edges_test"],
    "axis_client": ["core/axis_test", "core/axis_edges_test"],
    "axis_link": ["core/axis_test", "core/axis_edges_test"],
    "axis_poll": ["core/axis_test", "core/axis_edges_test"],
    "validity": ["core/axis_test", "core/axis_edges_test"],
    "latch_skew": ["core/bus_group_test"],
    "port": ["core/bus_test"],
    "exchange": ["core/exchange_test", "core/bus_test"],
    "background": ["core/background_test", "core/bus_background_test"],
    "pattern": ["core/pattern_test", "core/scheduler_test"],
    "scheduler": ["core/scheduler_test", "core/pattern_test", "core/bus_pattern_test"],
    "position_tracker": ["core/position_tracker_test", "core/position_limits_test"],
    "sample": ["core/position_tracker_test", "core/bus_test"],
    "axis_config": ["core/position_tracker_test", "core/position_limits_test"],
    "eeprom": ["integration/eeprom_hold_test", "integration/eeprom_speed_test"],
    "eeprom_steps": ["integration/eeprom_hold_test", "integration/eeprom_speed_test"],
    "reset_run": ["integration/reset_run_test"],
    "time": ["core/bus_test"],
    "estimator_fixed": ["core/estimator_test"],
    "estimator_gains": ["core/estimator_test"],
    "state_covariance": ["core/estimator_test"],
}
ALL = ["core/*_test.cpp", "integration/*_test.cpp", "sync/*.cpp", "c/*_test.cpp"]
C_SOURCES = ["tests/c/*.c"]

SWAPS = [
    (re.compile(r" (<=|>=|<|>|==|!=) "), {"<=": "<", ">=": ">", "<": "<=", ">": ">=", "==": "!=", "!=": "=="}),
    (re.compile(r" (&&|\|\|) "), {"&&": "||", "||": "&&"}),
    (re.compile(r" (\+|-|\*|/|&|\||\^|<<|>>|\+=|-=|\|=|&=) "),
     {"+": "-", "-": "+", "*": "/", "/": "*", "&": "|", "|": "&", "^": "|", "<<": ">>", ">>": "<<", "+=": "-=", "-=": "+=",
      "|=": "&=", "&=": "|="}),
    (re.compile(r"(\+\+|--)(?=\w)"), {"++": "--", "--": "++"}),
    (re.compile(r"\b(true|false)\b"), {"true": "false", "false": "true"}),
]
NUMBER = re.compile(r"(?<![\w.'])(0x[0-9A-Fa-f']+|\d[\d']*)(?=[uUlL]*\b)(?!\.)")
IF = re.compile(r"\bif \((.+?)\)(?= (?:return|\{|\[\[|continue|break|\w+\(|\+\+|\w[\w.]* [-+|&]?= )|$)")
STATEMENT = re.compile(r"^\s+(?:[\w.\->\[\]:]+ [-+|&^]?= .*;|[\w.\->:]+\(.*\);|\+\+[\w.\->]+;|return;)$")
DECLARATION = re.compile(r"^\s*(?:const|constexpr|static|inline|using|auto|return|template|friend|explicit|#|//|\[\[)")
SKIPPED = re.compile(r"^\s*(?://|#|static_assert|template|using|namespace|case |default:|\[\[nodiscard\]\] static consteval)|operator|sizeof|^\s*///")


def code_of(text):
    """The text with comments and string literals blanked, so that places stay where they are."""
    blank = lambda match: re.sub(r"[^\n]", " ", match.group(0))
    return re.sub(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', blank, text, flags=re.S)


def mutants_of(name, text):
    """(name, line number, begin, end, replacement, kind), begin and end in the whole text."""
    found = []
    at = 0
    for number, line in enumerate(code_of(text).split("\n"), 1):
        start, at = at, at + len(line) + 1
        if SKIPPED.search(line) or not line.strip():
            continue
        for pattern, swap in SWAPS:
            for hit in pattern.finditer(line):
                before = line[: hit.start()]
                if hit.group(1) in "<>" and ("template" in line or "#include" in line):
                    continue
                if hit.group(1) in ("&", "*") and re.search(r"[\w>]$", before) and re.match(r"\s*\w+[,)]", line[hit.end(1):]) is None and "const" in before:
                    continue
                found.append((name, number, start + hit.start(1), start + hit.end(1), swap[hit.group(1)], "operator"))
        for hit in NUMBER.finditer(line):
            digits = hit.group(1).replace("'", "")
            value = int(digits, 0) if digits.startswith("0x") or digits == "0" or not digits.startswith("0") else int(digits)
            for other in (value + 1, value - 1):
                if other >= 0:
                    found.append((name, number, start + hit.start(1), start + hit.end(1), str(other), "constant"))
        for hit in IF.finditer(line):
            if "constexpr" in line or ";" in hit.group(1) or hit.group(1).count("(") != hit.group(1).count(")"):
                continue
            found.append((name, number, start + hit.start(1), start + hit.end(1), f"!({text[start + hit.start(1):start + hit.end(1)]})", "negated"))
        if STATEMENT.match(line) and not DECLARATION.match(line) and line.count("(") == line.count(")"):
            indent = len(line) - len(line.lstrip())
            found.append((name, number, start + indent, start + len(line.rstrip()), ";", "removed"))
    return found


def sites():
    found = []
    for folder in MUTATED:
        for path in sorted((TREE / folder).rglob("*.[ch]pp")):
            name = str(path.relative_to(TREE))
            if not NOT_MUTATED.search(name):
                found += mutants_of(name, path.read_text())
    return found


def describe(mutant, text):
    name, number, begin, end, new, kind = mutant
    line = text.split("\n")[number - 1].strip()
    return f"{name}:{number}: {kind}: {text[begin:end]!r} -> {new!r} in: {line}"


def copy_tree():
    shutil.rmtree(TREE, ignore_errors=True)
    TREE.mkdir(parents=True)
    archive = subprocess.Popen(["git", "-c", f"safe.directory={ROOT}", "-C", str(ROOT), "archive", "HEAD"], stdout=subprocess.PIPE)
    subprocess.run(["tar", "-x", "-C", str(TREE)], stdin=archive.stdout, check=True)
    if archive.wait() != 0:
        raise SystemExit("mutants: git archive failed")


class Outcome(Exception):
    def __init__(self, verdict, by):
        self.verdict, self.by = verdict, by


class Builder:
    def __init__(self, jobs):
        self.pool = concurrent.futures.ThreadPoolExecutor(jobs)
        self.launcher = [found] if (found := shutil.which("ccache")) else []
        self.environment = dict(os.environ, CCACHE_BASEDIR=str(TREE), CCACHE_NOHASHDIR="1")

    def compile(self, source):
        target = WORK / "objects" / (source.replace("/", "_") + ".o")
        target.parent.mkdir(parents=True, exist_ok=True)
        c = source.endswith(".c")
        flags = ["-std=c99", "-O1", "-w"] if c else list(FLAGS)
        if source.startswith("core/"):
            flags += ["-fno-exceptions", "-fno-rtti", "-fno-strict-aliasing"]
        command = self.launcher + ["gcc" if c else "g++"] + flags + [f"-I{TREE}/{i}" for i in INCLUDES] + ["-c", f"{TREE}/{source}", "-o", str(target)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=BUILD_SECONDS, env=self.environment)
        except subprocess.TimeoutExpired:
            raise Outcome("stillborn", "compiles for too long")
        if done.returncode != 0:
            if "static assertion failed" in done.stderr:
                raise Outcome("killed", f"static_assert, {source}")
            raise Outcome("stillborn", (re.findall(r"error: .*", done.stderr) or [done.stderr[-200:]])[0])
        return str(target)

    def run(self, name, tests):
        """Raises Outcome("killed", ...) if a test notices."""
        sources = [str(p.relative_to(TREE)) for pattern in LIBRARY for p in sorted(TREE.glob(pattern))]
        sources = [s for s in sources if not LIBRARY_NOT.search(s)] + tests
        jobs = [self.pool.submit(self.compile, source) for source in sources]
        problems = []
        objects = []
        for job in jobs:
            try:
                objects.append(job.result())
            except Outcome as outcome:
                problems.append(outcome)
        if problems:
            raise min(problems, key=lambda p: p.verdict != "killed")
        program = WORK / name
        linked = subprocess.run(["g++", "-o", str(program), *objects, "-lgmock", "-lgtest", "-lgtest_main", "-lpthread"], capture_output=True, text=True)
        if linked.returncode != 0:
            raise Outcome("stillborn", "does not link: " + linked.stderr[-300:])
        try:
            done = subprocess.run([str(program), "--gtest_brief=1", "--gtest_fail_fast", "--gtest_filter=-SpscRingWrap.*:ProgramInC.*"],
                                  capture_output=True, text=True, errors="replace", timeout=RUN_SECONDS, cwd=TREE)
        except subprocess.TimeoutExpired:
            raise Outcome("killed", "runs for too long")
        if done.returncode != 0:
            failed = re.findall(r"\[  FAILED  \] ([\w/.]+)", done.stdout)
            raise Outcome("killed", failed[0] if failed else f"exit code {done.returncode}: {(done.stderr.strip().splitlines() or [''])[-1][:120]}")


def tests_of(name):
    stem = Path(name).stem
    first = FIRST.get(stem) or [f"core/{stem}_test", f"sync/{stem}_test"]
    found = [f"tests/{t}.cpp" for t in first if (TREE / f"tests/{t}.cpp").exists()]
    found += [str(p.relative_to(TREE)) for p in sorted(TREE.glob(f"tests/core/{stem}_*test.cpp")) if f"tests/core/{p.name}" not in found][:2] if stem not in FIRST else []
    if "/sync/" in name:
        found += [str(p.relative_to(TREE)) for p in sorted(TREE.glob(f"tests/sync/*{stem}*.cpp"))]
    return list(dict.fromkeys(found))


def everything():
    return [str(p.relative_to(TREE)) for pattern in ALL for p in sorted(TREE.glob("tests/" + pattern))] + [
        str(p.relative_to(TREE)) for pattern in C_SOURCES for p in sorted(TREE.glob(pattern))]


def judge(builder, mutant, text):
    name, _, begin, end, new, _ = mutant
    path = TREE / name
    path.write_text(text[:begin] + new + text[end:])
    try:
        first = tests_of(name)
        if first:
            builder.run("first", first)
        builder.run("all", everything())
    except Outcome as outcome:
        return outcome.verdict, outcome.by
    finally:
        path.write_text(text)
    return "survived", ""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--seed", default="1")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 2)
    parser.add_argument("--minutes", type=float, default=0, help="no further mutant is begun after this; 0: no bound")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--only", metavar="FILE:LINE")
    arguments = parser.parse_args()
    copy_tree()
    candidates = sites()
    if arguments.only:
        name, _, line = arguments.only.rpartition(":")
        candidates = [m for m in candidates if m[0] == name and m[1] == int(line)]
        arguments.count = len(candidates)
    # One file after the other would be chosen by its length; so it is, but not one line twice.
    random.Random(int(hashlib.sha256(str(arguments.seed).encode()).hexdigest(), 16)).shuffle(candidates)
    texts = {m[0]: (TREE / m[0]).read_text() for m in candidates}
    print(f"{len(candidates)} possible mutants, seed {arguments.seed}", flush=True)
    if arguments.list:
        for mutant in candidates[: arguments.count]:
            print(describe(mutant, texts[mutant[0]]))
        return 0
    builder = Builder(arguments.jobs)
    started = time.monotonic()
    try:
        builder.run("all", everything())
    except Outcome as outcome:
        print(f"mutants: the tests do not pass without one: {outcome.verdict}: {outcome.by}")
        return 1
    print(f"the tests pass without a mutant ({time.monotonic() - started:.0f} s)", flush=True)
    counts = {"killed": 0, "survived": 0, "stillborn": 0}
    lines = set()
    for mutant in candidates:
        if counts["killed"] + counts["survived"] >= arguments.count:
            break
        if arguments.minutes and time.monotonic() - started > arguments.minutes * 60:
            print(f"stopped after {arguments.minutes:g} minutes", flush=True)
            break
        if not arguments.only and (mutant[0], mutant[1]) in lines:
            continue
        lines.add((mutant[0], mutant[1]))
        since = time.monotonic()
        verdict, by = judge(builder, mutant, texts[mutant[0]])
        counts[verdict] += 1
        if verdict != "stillborn":
            print(f"{verdict:8} {time.monotonic() - since:4.0f} s  {describe(mutant, texts[mutant[0]])}{'   by ' + by if by else ''}", flush=True)
    judged = counts["killed"] + counts["survived"]
    print(f"{judged} mutants, {counts['killed']} killed, {counts['survived']} survived")
    return 1 if judged == 0 or counts["survived"] > max(1, judged // 20) else 0


if __name__ == "__main__":
    sys.exit(main())
