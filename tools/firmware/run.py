#!/usr/bin/env python3
"""Runs the firmware examples in QEMU: called by tools/firmware-test.sh, which builds what it needs.

    tools/firmware/run.py [--only WORD]...     only what has these words in its name
    tools/firmware/run.py --built ...          as a test of CTest: skipped if something that it needs is not built

Each run is a line, PASS or FAIL; then a table, and "N passed, N failed". Exit codes: 0 all passed, 1 not, 2 usage,
77 skipped."""

import argparse
import concurrent.futures
import os
import shutil
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import NamedTuple

import checks
from machine import Failed

ROOT = Path(__file__).resolve().parent.parent.parent
AT_ONCE = 1  # two machines beside each other on two cores leave their encoders too little


class Board(NamedTuple):
    name: str
    machine: str  # of QEMU
    preset: str


class Run(NamedTuple):
    example: str
    board: Board
    scenario: str
    function: object


STM32 = Board("stm32f405", "netduinoplus2", "arm")
MPS2 = Board("mps2_an386", "mps2-an386", "arm")
MICROBIT = Board("microbit", "microbit", "arm-m0plus")

RUNS = [
    Run(example, board, scenario, function)
    for example in ("servo_node", "servo_node_c")
    for board in (STM32, MPS2)
    for scenario, function in (("clean", checks.clean_run), ("faults", checks.faulty_run))
] + [
    Run("minimal", MICROBIT, "clean", checks.minimal_clean_run),
    Run("minimal", MICROBIT, "faults", checks.minimal_faulty_run),
    Run("vectors", STM32, "clean", checks.vectors_run),
    Run("vectors", MPS2, "clean", checks.vectors_run),
]

printing = threading.Lock()


def attempt(run, program, folder, name):
    """A row of the table. Once, but where the host may be to blame: that again, with more patience, and it is said."""
    for again, pace in enumerate(checks.PACES):
        place = Path(folder) / str(again)
        place.mkdir()
        try:
            tool = str(ROOT / "build/dev/tools/tm485")
            cycles, good, about = run.function(run.board, program, tool, str(place), pace)
            return (run, "passed", cycles, good, about)
        except (Failed, OSError) as why:
            if not isinstance(why, checks.HostWasLate) or pace is checks.PACES[-1]:
                return (run, "FAILED", "", "", str(why))
            with printing:
                print(f"AGAIN {name}: {why}", flush=True)


def program_of(run):
    return ROOT / "build" / run.board.preset / "integrations/firmware" / f"{run.example}_{run.board.name}.elf"


def missing(runs):
    """What is not there of what the runs need."""
    needed = sorted({program_of(run) for run in runs}) + [ROOT / "build/dev/tools/tm485"]
    absent = [str(path.relative_to(ROOT)) for path in needed if not path.exists()]
    return absent + [tool for tool in ("qemu-system-arm",) if shutil.which(tool) is None]


def execute(run):
    program = program_of(run)
    name = f"{run.example} on {run.board.machine}, {run.scenario}"
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="tm485-firmware-") as folder:
        row = attempt(run, str(program), folder, name)
    with printing:
        verdict = "PASS" if row[1] == "passed" else "FAIL"
        print(f"{verdict} {name} ({time.monotonic() - began:.0f} s): {row[4]}", flush=True)
    return row


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--only", action="append", default=[])
    parser.add_argument("--built", action="store_true")
    arguments = parser.parse_args()
    words = arguments.only
    runs = [run for run in RUNS if all(word in f"{run.example} {run.board.machine} {run.scenario}" for word in words)]
    if not runs:
        print("firmware: nothing has these words in its name", file=sys.stderr)
        return 2
    if arguments.built and (absent := missing(runs)):
        print(f"SKIP firmware: not there: {', '.join(absent)}; tools/firmware-test.sh installs and builds it")
        return 77
    try:
        os.setpriority(os.PRIO_PROCESS, 0, -20)  # as the machines: a console that nobody reads stops its machine
    except OSError:
        pass
    with concurrent.futures.ThreadPoolExecutor(AT_ONCE) as pool:
        rows = list(pool.map(execute, runs))
    print(f"\n{'example':<14} {'machine':<14} {'run':<8} {'cycles':>6} {'good':>6}  result")
    for run, result, cycles, good, about in rows:
        print(f"{run.example:<14} {run.board.machine:<14} {run.scenario:<8} {cycles:>6} {good:>6}  {result}: {about}")
    bad = sum(row[1] != "passed" for row in rows)
    print(f"\n{len(rows) - bad} passed, {bad} failed")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
