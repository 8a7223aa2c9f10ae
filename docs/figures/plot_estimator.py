#!/usr/bin/env python3
"""Draws velocity noise against phase lag from the CSV of tm485_estimator_curve, as SVG. Standard library only.

    tm485_estimator_curve > docs/figures/estimator_curve.csv
    docs/figures/plot_estimator.py docs/figures/estimator_curve.csv docs/figures/estimator_curve.svg
"""

import csv
import math
import sys

WIDTH, HEIGHT = 860, 520
LEFT, RIGHT, TOP, BOTTOM = 80, 190, 50, 60
COLOURS = {("2", "17"): "#1f5fa8", ("2", "23"): "#7fb0e0", ("3", "17"): "#a83a1f", ("3", "23"): "#e89a80"}


def main():
    source, target = sys.argv[1:3]
    with open(source, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    lag = [float(row["phase_lag_100hz_deg"]) for row in rows]
    noise = [1 / float(row["ratio"]) for row in rows]
    x_range = (math.floor(math.log10(min(lag))), math.ceil(math.log10(max(lag))))
    y_range = (math.floor(math.log10(min(noise))), math.ceil(math.log10(max(noise))))

    def x(value):
        return LEFT + (math.log10(value) - x_range[0]) / (x_range[1] - x_range[0]) * (WIDTH - LEFT - RIGHT)

    def y(value):
        return HEIGHT - BOTTOM - (math.log10(value) - y_range[0]) / (y_range[1] - y_range[0]) * (HEIGHT - TOP - BOTTOM)

    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}"'
        ' font-family="sans-serif" font-size="12">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        f'<text x="{LEFT}" y="24" font-size="15">Velocity noise against phase lag, 16 kHz, bandwidth 250 Hz to 4 kHz</text>',
    ]
    for exponents, line in ((range(x_range[0], x_range[1] + 1), "x"), (range(y_range[0], y_range[1] + 1), "y")):
        for exponent in exponents:
            value = 10.0**exponent
            if line == "x":
                out.append(f'<line x1="{x(value):.1f}" y1="{TOP}" x2="{x(value):.1f}" y2="{HEIGHT - BOTTOM}" stroke="#ddd"/>')
                out.append(f'<text x="{x(value):.1f}" y="{HEIGHT - BOTTOM + 18}" text-anchor="middle">{value:g}</text>')
            else:
                out.append(f'<line x1="{LEFT}" y1="{y(value):.1f}" x2="{WIDTH - RIGHT}" y2="{y(value):.1f}" stroke="#ddd"/>')
                out.append(f'<text x="{LEFT - 8}" y="{y(value) + 4:.1f}" text-anchor="end">{value:g}</text>')
    out.append(
        f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 16}" text-anchor="middle">'
        "phase lag of the velocity at 100 Hz, degrees</text>"
    )
    out.append(
        f'<text transform="translate(22 {(TOP + HEIGHT - BOTTOM) / 2}) rotate(-90)" text-anchor="middle">'
        "velocity noise, plain differencing = 1</text>"
    )
    for place, ((states, bits), colour) in enumerate(COLOURS.items()):
        mine = [row for row in rows if row["states"] == states and row["bits"] == bits]
        points = [(x(float(r["phase_lag_100hz_deg"])), y(1 / float(r["ratio"])), r["bandwidth_hz"]) for r in mine]
        path = " ".join(f"{px:.1f},{py:.1f}" for px, py, _ in points)
        out.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>')
        for px, py, bandwidth in points:
            out.append(f'<circle cx="{px:.1f}" cy="{py:.1f}" r="3.5" fill="{colour}"/>')
            if bits == "17" and bandwidth in ("250", "500", "1000", "2000", "4000"):
                out.append(f'<text x="{px + 7:.1f}" y="{py - 6:.1f}" font-size="11" fill="#444">{bandwidth} Hz</text>')
        key = TOP + 20 + 22 * place
        out.append(f'<line x1="{WIDTH - RIGHT + 20}" y1="{key}" x2="{WIDTH - RIGHT + 50}" y2="{key}" stroke="{colour}" stroke-width="2"/>')
        out.append(f'<text x="{WIDTH - RIGHT + 58}" y="{key + 4}">{states} states, {bits} bits</text>')
    out.append("</svg>")
    with open(target, "w", encoding="utf-8") as file:
        file.write("\n".join(out) + "\n")


if __name__ == "__main__":
    main()
