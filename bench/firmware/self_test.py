"""Seeds one fault of each kind that report.py must find, and says which it did not.

Figures that grew, are missing or miss their goal; and small programs for a Cortex-M with a recursion, a call through a
pointer, a frame of variable size, a 64-bit division.
"""

import copy
import subprocess
import tempfile
from pathlib import Path

from callgraph import CallGraph, Refused

CALM = """
__attribute__((noinline)) int leaf(volatile int* at) { volatile char room[40]; room[3] = 1; return *at + room[3]; }
__attribute__((noinline)) int middle(volatile int* at) { volatile char room[80]; room[5] = 2; return leaf(at) + room[5]; }
int entry(volatile int* at) { return middle(at) + 1; }
"""
PROGRAMS = {
    "recursion": "__attribute__((noinline)) int again(volatile int* at);"
    "int entry(volatile int* at) { return again(at) + 1; }"
    "int again(volatile int* at) { volatile char room[16]; room[0] = 1; return *at ? entry(at) + room[0] : 0; }",
    "through a pointer": "int entry(int (*call)(int)) { volatile char room[16]; room[0] = 1; return call(1) + room[0]; }",
    "a frame that is": "int entry(unsigned count) { volatile char room[count]; room[0] = 1; return room[0]; }",
}
DIVISION = "long long entry(long long by, long long what) { return what / by; }"


def graph_of(source, folder, cpu):
    """The call graph of a program, whose function is called entry."""
    for old in folder.iterdir():
        old.unlink()
    (folder / "program.c").write_text(source)
    flags = [f"-mcpu={cpu}", "-mthumb", "-O2", "-fno-optimize-sibling-calls", "-fcallgraph-info=su", "-ffreestanding"]
    link = ["-nostartfiles", "-nodefaultlibs", "-Wl,--entry=entry"]
    command = ["arm-none-eabi-gcc", *flags, *link, "program.c", "-lgcc", "-o", "program"]
    subprocess.run(command, cwd=folder, check=True)
    return CallGraph(folder / "program", folder, {})


def refusal(source, folder, cpu):
    try:
        graph_of(source, folder, cpu).stack("entry")
    except Refused as refused:
        return str(refused)
    return ""


def programs(missed, divisions):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for cpu in ("cortex-m0plus", "cortex-m4"):
            depth = graph_of(CALM, folder, cpu).stack("entry")
            if not 120 <= depth <= 200:
                missed.append(f"{cpu}: a stack of 120 bytes and some registers is {depth}")
            missed += [f"{cpu}: {what}" for what, source in PROGRAMS.items() if what not in refusal(source, folder, cpu)]
            graph = graph_of(DIVISION, folder, cpu)
            if not any(divisions.match(function) for function in graph.reached("entry")):
                missed.append(f"{cpu}: 64-bit division")
            if graph.stack("entry") < graph.frame("entry") + 24:
                missed.append(f"{cpu}: what the run-time library pushes")


def figures(missed, record, compare, goals):
    """`compare` must be silent on the record itself, and on 5 %, and must name each change beyond."""
    if compare(record, record):
        missed.append("the record differs from itself")
    kind, figure, variant = "instructions", "cycle", "m4f-O2"

    def changed(value):
        report = copy.deepcopy(record)
        report["figures"][kind][variant][figure] = value
        return report

    then = record["figures"][kind][variant][figure]
    if compare(changed(int(then * 1.05)), record):
        missed.append("5 % are refused")
    if not compare(changed(int(then * 1.05) + 1), record):
        missed.append("more than 5 % pass")
    without = copy.deepcopy(record)
    del without["figures"][kind][variant][figure]
    if not compare(without, record) or not compare(record, without):
        missed.append("a missing figure passes")
    for key, goal in goals.items():
        kind, variant, figure = key[0], key[2], key[1]
        if not compare(changed(goal + 1), changed(goal)):
            missed.append(f"{' '.join(key)}: a goal that is not met any more passes")
