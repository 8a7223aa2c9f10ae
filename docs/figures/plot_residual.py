#!/usr/bin/env python3
"""Draws dangerous undetected samples per frame against the bit error rate, as SVG, from the JSON of tm485_residual_error;
or prints them as a table. Standard library only.

    tm485_residual_error --frames 1e8 --json > docs/figures/residual_error.json
    docs/figures/plot_residual.py docs/figures/residual_error.json docs/figures/residual_error.svg
    docs/figures/plot_residual.py --table docs/figures/residual_error.json
"""

import json
import math
import sys

WIDTH, HEIGHT = 860, 520
LEFT, RIGHT, TOP, BOTTOM = 80, 210, 50, 60
CURVES = (
    ("crc_dangerous", "CRC alone", "#888888"),
    ("strict_dangerous", "strict parsing", "#1f5fa8"),
    ("gate_dangerous_start_up", "parsing and gate, at start", "#e89a80"),
    ("gate_dangerous", "parsing and gate", "#a83a1f"),
)
X_RANGE, Y_RANGE = (-5, -2), (-15, -1)


def x(value):
    return LEFT + (math.log10(value) - X_RANGE[0]) / (X_RANGE[1] - X_RANGE[0]) * (WIDTH - LEFT - RIGHT)


def y(value):
    return HEIGHT - BOTTOM - (math.log10(value) - Y_RANGE[0]) / (Y_RANGE[1] - Y_RANGE[0]) * (HEIGHT - TOP - BOTTOM)


def axes():
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}"'
        ' font-family="sans-serif" font-size="12">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        f'<text x="{LEFT}" y="24" font-size="15">Undetected samples that are wrong by more than 0.18°, per frame</text>',
    ]
    for exponent in range(X_RANGE[0], X_RANGE[1] + 1):
        at = x(10.0**exponent)
        out.append(f'<line x1="{at:.1f}" y1="{TOP}" x2="{at:.1f}" y2="{HEIGHT - BOTTOM}" stroke="#ddd"/>')
        out.append(f'<text x="{at:.1f}" y="{HEIGHT - BOTTOM + 18}" text-anchor="middle">1e{exponent}</text>')
    for exponent in range(Y_RANGE[0], Y_RANGE[1] + 1, 2):
        at = y(10.0**exponent)
        out.append(f'<line x1="{LEFT}" y1="{at:.1f}" x2="{WIDTH - RIGHT}" y2="{at:.1f}" stroke="#ddd"/>')
        out.append(f'<text x="{LEFT - 8}" y="{at + 4:.1f}" text-anchor="end">1e{exponent}</text>')
    out.append(
        f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 16}" text-anchor="middle">bit error rate, independent bits</text>'
    )
    return out


def plot(lines, target):
    out = axes()
    for place, (name, title, colour) in enumerate(CURVES):
        points = [(x(line["bit_error_rate"]), line[name]) for line in lines if line["bit_error_rate"] > 0]
        path = " ".join(f"{px:.1f},{y(value['high']):.1f}" for px, value in points)
        out.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>')
        for px, value in points:
            seen = value["rate"] > 0
            out.append(f'<circle cx="{px:.1f}" cy="{y(value["high"]):.1f}" r="4" stroke="{colour}" fill="{colour if seen else "white"}"/>')
        key = TOP + 20 + 22 * place
        out.append(f'<line x1="{WIDTH - RIGHT + 12}" y1="{key}" x2="{WIDTH - RIGHT + 36}" y2="{key}" stroke="{colour}" stroke-width="2"/>')
        out.append(f'<text x="{WIDTH - RIGHT + 42}" y="{key + 4}">{title}</text>')
    key = TOP + 20 + 22 * len(CURVES)
    for text in ("upper ends of the 95 % bounds;", "hollow: none was seen"):
        out.append(f'<text x="{WIDTH - RIGHT + 12}" y="{key + 4}" fill="#444">{text}</text>')
        key += 18
    out.append("</svg>")
    with open(target, "w", encoding="utf-8") as file:
        file.write("\n".join(out) + "\n")


def power(value):
    return f"{value:.2g}" if value > 0 else "0"


def cell(value):
    if value["rate"] == 0:
        return f"0, below {power(value['high'])}"
    if value["high"] - value["low"] < 0.02 * value["rate"]:
        return f"{value['rate']:.3g}"
    return f"{power(value['rate'])} ({power(value['low'])} to {power(value['high'])})"


def table(lines):
    columns = ("crc_wrong", "strict_wrong", "gate_wrong", *(name for name, _, _ in CURVES))
    print("| line | CRC: wrong | strict: wrong | gate: wrong | CRC: dangerous | strict: dangerous | gate: dangerous,"
          " 16 frames behind a restart | gate: dangerous | fewer than strict, at least |")  # fmt: skip
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    for line in lines:
        cells = [cell(line[name]) for name in columns]
        print(f"| {line['line']} | " + " | ".join(cells) + f" | {line['fewer_than_strict']:.2g} |")
    names = ("frames", "changed", "fresh", "crc_wrong", "crc_dangerous", "strict_wrong", "strict_dangerous", "gate_wrong",
             "gate_dangerous", "largest_error", "beyond_half_width", "beyond_by_more_wrong_readings",
             "held_back", "discontinuities", "put_in", "put_in_dangerous", "put_in_start_up", "put_in_start_up_dangerous")  # fmt: skip
    print()
    print("| counted | " + " | ".join(line["line"] for line in lines) + " |")
    print("|---|" + "--:|" * len(lines))
    for name in names:
        print(f"| {name.replace('_', ' ')} | " + " | ".join(str(line["counted"][name]) for line in lines) + " |")


def main():
    tabular = sys.argv[1] == "--table"
    with open(sys.argv[2] if tabular else sys.argv[1], encoding="utf-8") as file:
        lines = json.load(file)["lines"]
    if tabular:
        table(lines)
    else:
        plot(lines, sys.argv[2])


if __name__ == "__main__":
    main()
