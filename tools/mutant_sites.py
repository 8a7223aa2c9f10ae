"""Where a C++ source can be broken by one small change (tools/mutants.py is the user).

A change is an operator swapped, a constant one more or less, a statement removed, a condition negated, true for false.
Found by regular expressions in the text without comments and literals: what does not compile is sorted out later.
"""

import re

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
