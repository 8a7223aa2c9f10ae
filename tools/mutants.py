#!/usr/bin/env python3
"""Breaks the core on purpose, one small change at a time, and looks whether a test notices.

    tools/mutants.py [--count N] [--seed S] [--jobs J] [--minutes M] [--least P]
                                                                   N mutants chosen by S (an integer or any text)
    tools/mutants.py --list [--count N] [--seed S]                     shows them, builds nothing
    tools/mutants.py --only FILE[:LINE]                                those of one file or line
    tools/mutants.py --explained                                       those that tests/mutant_exceptions.txt excuses
    tools/mutants.py --check                                           whether each of them can still be made; builds nothing

A mutant is one of: an operator swapped (< <= == && + & << ...), a constant one more or less, a statement removed, a
condition negated, true for false (tools/mutant_sites.py). Initial values of private members, and 0 and false of the
others, are left alone: most are set again before anybody reads them, and are there for the linter. A mutant is killed if
a test fails or runs for too long, or if a static_assert refuses it; one that does not compile for another reason is no
mutant, and the next is taken. It survives if nothing notices in tests/core, integration, sync, c, design, the corpora of
tests/fuzz, or 50 000 cycles of tests/campaign. tests/mutant_exceptions.txt holds survivors that no test can kill, each
with the reason: they are counted apart.

Each file of tests is a program of its own here. A mutant meets the tests that belong to its file first, then the others,
those first that have noticed most; the first that fails ends it. Only what includes the changed file is compiled again; a
program is run if that has changed an object in it, and it is run without a mutant before it may judge one.

Works on a copy of the last commit in build/mutants, where objects are kept for the next run. The last line is
"N mutants, N killed, N survived, N of these explained". Exit code 1 if more than 5 in 100 survive without an explanation
(with up to 20 mutants: more than one; or by --least), and if one that is explained was killed; 77 if --minutes ended it
before N were judged.
"""

import argparse
import collections
import concurrent.futures
import filecmp
import hashlib
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

from mutant_sites import mutants_of

ROOT = Path(__file__).resolve().parent.parent
WORK = ROOT / "build" / "mutants"
TREE = WORK / "tree"
EXCEPTIONS = "tests/mutant_exceptions.txt"
CUT_SHORT = 77  # as tests have it that were skipped
MUTATED = ["core/src", "core/include"]
# Texts and numbers that no test can know better.
NOT_MUTATED = re.compile(r"core/src/(errc|version)\.cpp|version\.h(pp)?$|sync/atomics\.hpp")
# Initial values: of private members, and those of others that say nothing.
RECORDS = [re.compile(rf"^{at}(?:struct|class) [^;{{]*\{{\n.*?^{at}\}};", re.M | re.S) for at in ("", "  ")]
INITIAL = re.compile(r"( +)[\w:<>, ]+ (?:\w+_(?:\{[^{}();]*\}| = [^();=]+)|\w+(?:\{0?\}| = (?:0|0\.0F|false)));")
INCLUDES = ["core/include", "core/c/include", "core/c/src", "core/design/include", "hal/sim/include", "tests"]
FLAGS = ["-w", "-D_GLIBCXX_ASSERTIONS", "-DTM485_TEST_SLOW", f'-DTM485_TEST_VECTORS="{TREE}/tests/vectors"', f'-DTM485_FUZZ_CORPUS="{TREE}/tests/fuzz/corpus"']
# Most tests of the core take longer to compile than to run; the others simulate millions of cycles.
NOT_OPTIMISED = re.compile(r"tests/(core|c)/|core/c/")
# What the tests include besides; compiled once.
PRECOMPILED = ["gmock/gmock.h", "gtest/gtest.h", "algorithm", "array", "chrono", "expected", "functional", "map", "memory", "optional", "random",
               "span", "string", "vector"]
LIBRARY = ["core/src/*.cpp", "hal/sim/src/*.cpp"]
LIBRARY_NOT = re.compile(r"hal/sim/src/(server|endpoint|eeprom_file)\.cpp")
LIBRARY_C = ["core/c/src/*.cpp"]
LIBRARY_DESIGN = ["core/design/src/*.cpp"]
# Seconds of processor time: a machine that has other work kills no mutant. No program needs a third of it without one.
BUILD_SECONDS, RUN_SECONDS = 60, 20
# And of the clock, for what waits for ever.
WALL_SECONDS = 900

# The tests of a file, by its stem; otherwise those that have its name.
FIRST = {
    "layout": "core/frame core/request",
    "frame": "core/frame core/frame_faults",
    "crc": "core/crc core/frame",
    "profile": "core/profile core/frame",
    "profile_compile": "core/profile core/frame",
    "bus": "core/bus core/bus_accounts core/bus_trust",
    "bus_poll": "core/bus core/bus_accounts core/bus_limits core/bus_trust core/bus_background",
    "bus_reply": "core/bus core/bus_accounts core/bus_limits core/bus_trust",
    "bus_states": "core/bus core/bus_accounts core/bus_limits core/bus_background core/bus_trust",
    "axis": "core/axis core/axis_edges",
    "axis_client": "core/axis core/axis_edges",
    "axis_link": "core/axis core/axis_edges",
    "axis_poll": "core/axis core/axis_edges core/axis_trust",
    "validity": "core/axis core/axis_edges",
    "latch_skew": "core/bus_group integration/bus_group",
    "bus_group": "core/bus_group integration/bus_group",
    "port": "core/bus",
    "exchange": "core/exchange core/bus",
    "background": "core/background core/bus_background",
    "pattern": "core/pattern core/scheduler",
    "scheduler": "core/scheduler core/pattern core/bus_pattern",
    "position_tracker": "core/position_tracker core/position_limits",
    "sample": "core/position_tracker core/bus",
    "axis_config": "core/position_tracker core/position_limits",
    "eeprom": "core/eeprom_steps core/eeprom_patience integration/eeprom_hold",
    "eeprom_steps": "core/eeprom_steps core/eeprom_patience integration/eeprom_hold",
    "reset_run": "core/reset_steps integration/reset_run",
    "time": "core/time core/bus",
    "estimator_fixed": "core/estimator",
    "estimator_gains": "core/estimator",
    "state_covariance": "core/estimator",
}


class Outcome(Exception):
    """How a mutant ended."""

    def __init__(self, verdict, by):
        self.verdict, self.by = verdict, by


class NoJudge(Exception):
    """The tests are not fit to judge mutants."""


def limited(command, seconds, **options):
    """Runs it; None if it takes too long."""
    try:
        done = subprocess.run(["bash", "-c", f'ulimit -c 0 -v 4000000 -t {seconds}; exec "$@"', "bash", *command], capture_output=True, text=True,
                              errors="replace", timeout=WALL_SECONDS, **options)
    except subprocess.TimeoutExpired:
        return None
    return None if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL) else done


def copy_tree():
    for old in WORK.glob("*"):  # but what an earlier run has compiled
        if old != WORK / "objects":
            shutil.rmtree(old) if old.is_dir() else old.unlink()
    TREE.mkdir(parents=True)
    archive = subprocess.Popen(["git", "-c", f"safe.directory={ROOT}", "-C", str(ROOT), "archive", "HEAD"], stdout=subprocess.PIPE)
    subprocess.run(["tar", "-x", "-C", str(TREE)], stdin=archive.stdout, check=True)
    if archive.wait() != 0:
        raise SystemExit("mutants: git archive failed")


def files(*patterns, tree=TREE):
    return [str(p.relative_to(tree)) for pattern in patterns for p in sorted(tree.glob(pattern))]


class Program:
    """A program of tests: its own sources, what it links besides the core and the simulator, its arguments."""

    def __init__(self, name, sources, library=(), arguments=("--gtest_brief=1", "--gtest_fail_fast", "--gtest_filter=-SpscRingWrap.*")):
        self.name, self.sources, self.beside, self.arguments = name, sources, list(library), list(arguments)
        self.lock = threading.Lock()
        self.linked = []  # sources that are in it (of the libraries, what it uses), once it has passed without a mutant


def programs():
    found = [Program(re.sub(r"^tests/|(_test)?\.cpp$", "", source), [source])
             for source in files("tests/core/*_test.cpp", "tests/integration/*_test.cpp", "tests/sync/*.cpp")]
    stack = [f for f in files("tests/fuzz/targets/*.cpp") if Path(f).stem in "frame reply request exchange bus c sim_options plan".split()]
    return found + [
        Program("c", files("tests/c/*.cpp", "tests/c/*.c"), files(*LIBRARY_C)),
        Program("design", files("tests/design/*.cpp"), files(*LIBRARY_DESIGN)),
        Program("fuzz", files("tests/fuzz/replay/*.cpp") + stack, files(*LIBRARY_C)),
        Program("campaign", ["tests/campaign/loop_campaign.cpp"], arguments=["50000", "1"]),
    ]


class Objects:
    """Compiled files: those of the tree as it is, and, for one mutant at a time, those that its file changes."""

    def __init__(self):
        self.guard = threading.Lock()
        self.locks = collections.defaultdict(threading.Lock)
        self.plain = {}  # source: (object, the tree's files in it); also kept for the next run, with a digest of it all
        for level in ("-O0", "-O1"):
            header = WORK / f"precompiled{level}.hpp"
            header.write_text("".join(f"#include <{name}>\n" for name in PRECOMPILED))
            done = subprocess.run(["g++", "-std=c++23", level, *FLAGS, "-x", "c++-header", str(header), "-o", f"{header}.gch"], capture_output=True, text=True)
            if done.returncode != 0:
                raise SystemExit(f"mutants: {done.stderr[-1000:]}")

    def compile(self, source, folder, overlay=None):
        """(object, files of the tree in it). With an overlay, its files take the place of those of the tree."""
        target = folder / (source.replace("/", "_") + ".o")
        target.parent.mkdir(parents=True, exist_ok=True)
        trees = ([overlay] if overlay else []) + [TREE]
        path = next(t / source for t in trees if (t / source).exists())
        level = "-O0" if NOT_OPTIMISED.match(source) else "-O1"
        if source.endswith(".c"):
            command = ["gcc", "-std=c99"]
        elif source.startswith("core/") and not source.startswith("core/design/"):
            command = ["g++", "-std=c++23", "-fno-exceptions", "-fno-rtti", "-fno-strict-aliasing"]
        else:
            command = ["g++", "-std=c++23"] + (["-include", f"{WORK}/precompiled{level}.hpp"] if source.startswith("tests/") else [])
        command += [level, *FLAGS] + [f"-I{t}/{i}" for t in trees for i in INCLUDES] + ["-isystem", "/usr/include/eigen3"]
        command += ["-MMD", "-MF", f"{target}.d", "-c", str(path), "-o", str(target)]
        digest = Path(f"{target}.digest")
        if not overlay and digest.exists() and digest.read_text() == self.digest_of(command, target):
            return target, self.files_in(target, trees)
        done = limited(command, BUILD_SECONDS)
        if done is None:
            raise Outcome("stillborn", "compiles for too long")
        if done.returncode != 0:
            if "static assertion failed" in done.stderr:
                raise Outcome("killed", f"static_assert, {source}")
            raise Outcome("stillborn", (re.findall(r"error: .*", done.stderr) or [done.stderr[-200:]])[0])
        if not overlay:
            digest.write_text(self.digest_of(command, target))
        return target, self.files_in(target, trees)

    @staticmethod
    def files_in(target, trees):
        seen = Path(f"{target}.d").read_text().replace("\\\n", " ").split()[1:]
        return {os.path.normpath(f)[len(str(t)) + 1:] for f in seen for t in trees if os.path.normpath(f).startswith(f"{t}/")}

    def digest_of(self, command, target):
        names = sorted(TREE / f for f in self.files_in(target, [TREE]))
        return hashlib.sha256(repr((command, [f.exists() and f.read_bytes() for f in names])).encode()).hexdigest()

    def of_tree(self, source):
        with self.guard:
            lock = self.locks[source]
        with lock:
            if source not in self.plain:
                self.plain[source] = self.compile(source, WORK / "objects")
            return self.plain[source]


class Judge:
    """Runs programs on the tree as it is, and on mutants. Each thread has a folder for its mutant."""

    def __init__(self):
        self.objects = Objects()
        self.common = [f for f in files(*LIBRARY) if not LIBRARY_NOT.search(f)]
        self.programs = programs()
        self.kills = collections.Counter()
        self.own = threading.local()
        self.folders = iter(range(1000))

    def link(self, program, inputs, folder):
        """The sources in it. An input that is an archive gives what is used of it."""
        libraries = [] if program.name == "campaign" else ["-lgmock", "-lgtest", "-lgtest_main"]
        done = subprocess.run(["g++", "-fuse-ld=gold", "-Wl,-t", "-o", str(folder / "program"), *map(str, inputs), *libraries, "-lpthread"], capture_output=True, text=True)
        if done.returncode != 0:
            raise Outcome("stillborn", "does not link: " + done.stderr[-300:])
        used = set(re.findall(r"([\w.]+)\.o\)?$", done.stdout + done.stderr, re.M))
        return [s for s in program.sources + program.beside + self.common if s.replace("/", "_") in used]

    def run(self, program, folder):
        """None, or what went wrong."""
        done = limited([str(folder / "program"), *program.arguments], RUN_SECONDS, cwd=folder)
        if done is None:
            return f"{program.name}, which runs for too long"
        if done.returncode == 0:
            return None
        failed = re.findall(r"\[  FAILED  \] ([\w/.]+)", done.stdout)
        return failed[0] if failed else f"{program.name}, exit code {done.returncode}: {((done.stderr or done.stdout).strip().splitlines() or [''])[-1][:120]}"

    def prove(self, program):
        """A program that fails without a mutant is no judge."""
        with program.lock:
            if program.linked:
                return
            folder = WORK / "plain" / program.name
            folder.mkdir(parents=True, exist_ok=True)
            try:
                library = [str(self.objects.of_tree(s)[0]) for s in program.beside + self.common]
                subprocess.run(["ar", "rcs", str(folder / "library.a"), *library], check=True)
                linked = self.link(program, [self.objects.of_tree(s)[0] for s in program.sources] + [folder / "library.a"], folder)
                wrong = self.run(program, folder)
            except Outcome as outcome:
                wrong = outcome.by
            if wrong:
                raise NoJudge(f"the tests do not pass without a mutant: {program.name}: {wrong}")
            program.linked = linked

    def order(self, name):
        """Those of its file, then the others, those that noticed most first."""
        stem = Path(name).stem
        first = FIRST.get(stem, f"core/{stem} sync/{stem}").split()
        own = [p for f in first for p in self.programs if p.name == f]
        if stem not in FIRST:
            own += [p for p in self.programs if stem in p.name and p not in own]
        return own + sorted((p for p in self.programs if p not in own), key=lambda p: -self.kills[p.name])

    def judge(self, mutant, text):
        """("killed", by whom), ("survived", "") or ("stillborn", why)."""
        name, _, begin, end, new, _ = mutant
        if not hasattr(self.own, "folder"):
            self.own.folder = WORK / f"mutant{next(self.folders)}"
        folder = self.own.folder
        shutil.rmtree(folder, ignore_errors=True)
        (folder / name).parent.mkdir(parents=True)
        (folder / name).write_text(text[:begin] + new + text[end:])
        changed = {}

        def mutated(source):
            plain, seen = self.objects.of_tree(source)
            if source not in changed:
                changed[source] = plain
                if name in seen:
                    built = self.objects.compile(source, folder / "objects", folder)[0]
                    changed[source] = plain if filecmp.cmp(plain, built, shallow=False) else built
            return changed[source], changed[source] != plain

        try:
            for program in self.order(name):
                self.prove(program)
                objects = [mutated(s) for s in program.linked]
                if not any(is_changed for _, is_changed in objects):
                    continue
                self.link(program, [o for o, _ in objects], folder)
                if by := self.run(program, folder):
                    self.kills[program.name] += 1
                    return "killed", by
        except Outcome as outcome:
            return outcome.verdict, outcome.by
        return "survived", ""


def describe(mutant, text):
    """The line as it is and as it becomes; (with its number, without)."""
    name, number, begin, end, new, _ = mutant
    start = text.rfind("\n", 0, begin) + 1
    stop = text.find("\n", end)
    change = f"{text[start:stop].strip()} => {(text[start:begin] + new + text[end:stop]).strip()}"
    return f"{name}:{number}: {change}", f"{name}: {change}"


def is_initial(mutant, text):
    begin = text.rfind("\n", 0, mutant[2]) + 1
    member = INITIAL.match(text, begin)
    if member is None or "static" in member[0]:
        return False
    # Bodies of functions are indented by more than the members around them.
    depth = len(member[1]) // 2 - 1
    return depth < len(RECORDS) and any(r.start() < begin < r.end() for r in RECORDS[depth].finditer(text))


def possible(tree):
    """(the text of each file, all mutants)."""
    texts = {name: (tree / name).read_text() for folder in MUTATED for name in files(f"{folder}/**/*.[ch]pp", tree=tree) if not NOT_MUTATED.search(name)}
    return texts, [mutant for name, text in texts.items() for mutant in mutants_of(name, text)]


def excuses(tree):
    found = {}
    for number, line in enumerate((tree / EXCEPTIONS).read_text().splitlines(), 1):
        if line.strip() and not line.startswith("#"):
            change, separator, why = line.rpartition("  # ")
            if not separator:
                raise SystemExit(f"{EXCEPTIONS}:{number}: expected 'FILE: LINE => CHANGED LINE  # why'")
            found[change] = why
    return found


def without_mutant(explained, texts, candidates):
    """Says which excuses are of code that has gone."""
    unknown = set(explained) - {describe(m, texts[m[0]])[1] for m in candidates}
    for change in sorted(unknown):
        print(f"{EXCEPTIONS}: no such mutant: {change}")
    return unknown


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--seed", default="1")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 2)
    parser.add_argument("--least", type=int, metavar="PERCENT", help="of those not explained that have to be killed; default: 95")
    parser.add_argument("--minutes", type=float, default=0, help="no further mutant is begun after this; 0: no bound")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--only", metavar="FILE[:LINE]")
    parser.add_argument("--explained", action="store_true")
    parser.add_argument("--check", action="store_true")
    arguments = parser.parse_args()
    if arguments.check:  # of the files as they are, not of the last commit
        explained = excuses(ROOT)
        unknown = without_mutant(explained, *possible(ROOT))
        print(f"{len(explained)} mutants explained, {len(unknown)} of them of code that has gone")
        return 1 if unknown else 0
    copy_tree()
    texts, candidates = possible(TREE)
    total = len(candidates)
    explained = excuses(TREE)
    unknown = without_mutant(explained, texts, candidates)
    if arguments.only or arguments.explained:
        if arguments.only:
            name, _, line = arguments.only.partition(":")
            candidates = [m for m in candidates if m[0] == name and (not line or m[1] == int(line))]
        if arguments.explained:
            candidates = [m for m in candidates if describe(m, texts[m[0]])[1] in explained]
        arguments.count = len(candidates)
    else:
        # A long file has many; but no line has two.
        random.Random(int(hashlib.sha256(str(arguments.seed).encode()).hexdigest(), 16)).shuffle(candidates)
        candidates = list({(m[0], m[1]): m for m in reversed(candidates) if not is_initial(m, texts[m[0]])}.values())[::-1]
    print(f"{total} possible mutants, seed {arguments.seed}", flush=True)
    if arguments.list:
        for mutant in candidates[: arguments.count]:
            print(describe(mutant, texts[mutant[0]])[0])
        return 1 if unknown else 0

    judge = Judge()
    started = time.monotonic()
    counts = collections.Counter()
    running = {}  # future: (mutant, when begun)
    left = iter(candidates)
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        while True:
            late = arguments.minutes and time.monotonic() - started > arguments.minutes * 60
            while not late and len(running) < arguments.jobs and counts["killed"] + counts["survived"] + len(running) < arguments.count:
                mutant = next(left, None)
                if mutant is None:
                    break
                running[pool.submit(judge.judge, mutant, texts[mutant[0]])] = mutant, time.monotonic()
            if not running:
                break
            for future in concurrent.futures.wait(running, return_when=concurrent.futures.FIRST_COMPLETED).done:
                mutant, since = running.pop(future)
                verdict, by = future.result()
                counts[verdict] += 1
                shown, key = describe(mutant, texts[mutant[0]])
                if key in explained:
                    counts["explained " + verdict] += 1
                if verdict != "stillborn":
                    print(f"{verdict:8} {time.monotonic() - since:4.0f} s  {shown}{'   by ' + by if by else ''}"
                          f"{'   explained: ' + explained[key] if key in explained else ''}", flush=True)
    judged = counts["killed"] + counts["survived"]
    if judged < arguments.count:
        print(f"{judged} of {arguments.count} in {arguments.minutes:g} minutes")
    wrong = counts["explained killed"]
    if wrong:
        print(f"{wrong} killed, though {EXCEPTIONS} says that none can")
    print(f"{time.monotonic() - started:.0f} s, {counts['stillborn']} more did not compile")
    print(f"{judged} mutants, {counts['killed']} killed, {counts['survived']} survived, {counts['explained survived']} of these explained")
    bad = counts["survived"] - counts["explained survived"]
    allowed = max(1, judged // 20) if arguments.least is None else judged * (100 - arguments.least) // 100
    if judged == 0 or wrong or unknown or bad > allowed:
        return 1
    return CUT_SHORT if arguments.minutes and judged < arguments.count else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except NoJudge as problem:
        sys.exit(f"mutants: {problem}")
