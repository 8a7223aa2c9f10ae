#!/usr/bin/env python3
"""What the core costs on Cortex-M: instructions, flash, RAM, stack, by Debian's GCC and QEMU.

    bench/firmware/report.py            builds, measures, prints the table, compares it with record.json
    bench/firmware/report.py --json     the figures as JSON instead of the table
    bench/firmware/report.py --record   makes them the record: rewrites record.json and docs/firmware-cost.md
    bench/firmware/report.py --self-test  seeds one fault of each kind and fails unless each is found

Fails if a figure is more than 5 % above the record, if one is missing in either, if a goal that the record meets is missed,
if the page does not show the record, or if the image holds what it must not. Needs: tools/setup.sh run check.
"""

import argparse
import json
import sys
from pathlib import Path

sys.dont_write_bytecode = True

import self_test  # noqa: E402
from callgraph import Refused  # noqa: E402
from measure import DIVISIONS, HERE, ROOT, VARIANTS, Variant, build_plugin, compiler  # noqa: E402

RECORD = HERE / "record.json"
PAGE = ROOT / "docs/firmware-cost.md"
BEGIN, END = "<!-- begin of the figures: bench/firmware/report.py --record -->", "<!-- end of the figures -->"
MOST_GROWTH = 1.05

# (kind, figure, variant): the most that it may be.
GOALS = {
    ("instructions", "decode_id3", "m4f-O2"): 75,
    ("instructions", "decode_id3", "m0-O2"): 120,
    ("instructions", "cycle", "m4f-O2"): 700,
    ("instructions", "cycle_untimed", "m4f-O2"): 700,
    ("flash", "codec, scheduler, position, statistics", "m4f-Os"): 8192,
    ("flash", "codec, scheduler, position, statistics", "m0-Os"): 8192,
    ("ram", "scheduler, position, statistics", "m4f-Os"): 768,
    ("ram", "scheduler, position, statistics", "m0-Os"): 768,
    **{("stack", "bus_poll", variant): 512 for variant in VARIANTS},
}

TITLES = {
    "instructions": "Instructions executed, callees included",
    "flash": "Flash by part, bytes (code and constants)",
    "ram": "RAM by type, bytes",
    "stack": "Deepest stack of what an interrupt calls, bytes",
}


def measure(folder):
    figures = {kind: {} for kind in TITLES}
    unwanted = []
    plugin = build_plugin(folder)
    for name in VARIANTS:
        variant = Variant(name, folder)
        variant.build()
        for kind in TITLES:
            figures[kind][name] = variant.instructions(plugin) if kind == "instructions" else getattr(variant, kind)()
        unwanted += [f"{name}: {what}" for what in variant.check_image()]
    return {"compiler": compiler(), "figures": figures}, unwanted


def flat(report):
    """(kind, figure, variant) to the figure."""
    return {
        (kind, figure, variant): value
        for kind, by_variant in report["figures"].items()
        for variant, by_figure in by_variant.items()
        for figure, value in by_figure.items()
    }


def rows_of(report, kind):
    """Figure to its row: a text for each variant, `-` where it has none."""
    by_variant = report["figures"][kind]
    names = list(dict.fromkeys(name for figures in by_variant.values() for name in figures))
    rows = []
    for name in names:
        goals = [f"{variant}: {goal}" for (k, n, variant), goal in GOALS.items() if (k, n) == (kind, name)]
        values = [str(by_variant[variant].get(name, "-")) for variant in VARIANTS]
        met = all(flat(report)[key] <= goal for key, goal in GOALS.items() if key[:2] == (kind, name))
        rows.append([name, *values, (", ".join(goals) + ("" if met else " (missed)")) if goals else ""])
    return rows


def table(report, markdown):
    lines = []
    for kind, title in TITLES.items():
        header = [title, *VARIANTS, "at most"]
        rows = rows_of(report, kind)
        if markdown:
            lines += ["", "| " + " | ".join(header) + " |", "|---" + "|--:" * len(VARIANTS) + "|---|"]
            lines += ["| " + " | ".join(row) + " |" for row in rows]
            continue
        wide = max(len(row[0]) for row in [header, *rows])
        lines.append("")
        for row in [header, *rows]:
            lines.append(row[0].ljust(wide) + "".join(cell.rjust(9) for cell in row[1:-1]) + "  " + row[-1])
    return "\n".join(line.rstrip() for line in lines).strip("\n")


def page_with(report):
    text = PAGE.read_text()
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    return f"{before}{BEGIN}\n\nCompiler: {report['compiler']}.\n\n{table(report, True)}\n\n{END}{after}"


def compare(report, record):
    """What is wrong, one line each."""
    now, then = flat(report), flat(record)
    wrong = []
    for key in now.keys() | then.keys():
        name = " ".join(key)
        if key not in then:
            wrong.append(f"{name}: not in the record")
        elif key not in now:
            wrong.append(f"{name}: in the record, but not measured any more")
        elif now[key] > then[key] * MOST_GROWTH:
            wrong.append(f"{name}: {now[key]}, {100 * now[key] / then[key] - 100:.1f} % more than the recorded {then[key]}")
        elif key in GOALS and now[key] > GOALS[key] >= then[key]:
            wrong.append(f"{name}: {now[key]}, above its goal of {GOALS[key]}, which the record meets")
    return sorted(wrong)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="prints the figures as JSON")
    parser.add_argument("--record", action="store_true", help="makes them the record")
    parser.add_argument("--build", type=Path, default=ROOT / "build/cost", help="folder of the builds (build/cost)")
    parser.add_argument("--self-test", action="store_true", help="seeds faults that must be found")
    options = parser.parse_args()
    if options.self_test:
        missed = []
        self_test.programs(missed, DIVISIONS)
        self_test.figures(missed, json.loads(RECORD.read_text()), compare, GOALS)
        for what in missed:
            print(f"not found: {what}", file=sys.stderr)
        print("self-test: " + ("failed" if missed else "every seeded fault was found"))
        return 1 if missed else 0
    try:
        report, wrong = measure(options.build.resolve())
    except Refused as refusal:
        print(refusal, file=sys.stderr)
        return 1
    print(json.dumps(report, indent=2) if options.json else f"{report['compiler']}\n\n{table(report, False)}")
    if options.record and not wrong:
        RECORD.write_text(json.dumps(report, indent=2) + "\n")
        PAGE.write_text(page_with(report))
    elif not options.record:
        record = json.loads(RECORD.read_text())
        if record["compiler"] != report["compiler"]:
            print(f"the record is of another compiler: {record['compiler']}", file=sys.stderr)
        grown = compare(report, record)
        if PAGE.read_text() != page_with(record):
            grown.append(f"{PAGE.relative_to(ROOT)} does not show {RECORD.relative_to(ROOT)}")
        if grown:
            grown.append("if it is meant to be so: bench/firmware/report.py --record, in the same commit")
        wrong += grown
    for line in wrong:
        print(line, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
