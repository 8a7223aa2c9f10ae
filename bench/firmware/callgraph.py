"""Worst-case stack and reachability over the call graph of a linked Cortex-M image.

The calls are read from the image's own instructions (arm-none-eabi-objdump), so nothing that is linked is overlooked.
Frames are those that the compiler states (-fcallgraph-info=su); of what has no such file, the compiler's and C's run-time
library, the pushes and the room made in its instructions are added up. What cannot be bounded is refused: recursion, a
frame of variable size, and a call through a pointer, unless it is declared.
"""

import re
import subprocess

NODE = re.compile(r'^node: \{ title: "([^"]+)" label: "([^"]*)"')
BYTES = re.compile(r"(\d+) bytes \(([^)]*)\)")
FUNCTION = re.compile(r"^[0-9a-f]+ <([^>]+)>:$")
TARGET = re.compile(r"<([^+>]+)(\+0x[0-9a-f]+)?>")
REGISTERS = re.compile(r"\{([^}]*)\}")
BRANCH = re.compile(r"^(b|b(eq|ne|cs|hs|cc|lo|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)|cbn?z)(\.[nw])?$")


class Refused(Exception):
    """Something that has no bound, or that may not be there."""


def demangled(names):
    names = list(names)
    out = subprocess.run(["arm-none-eabi-c++filt"], input="\n".join(names), capture_output=True, text=True, check=True)
    return dict(zip(names, out.stdout.splitlines()))


def stated_frames(folder):
    """Function to bytes, by the compiler's .ci files. A local function's title begins with its file."""
    frames = {}
    for path in sorted(folder.rglob("*.ci")):
        for line in path.read_text().splitlines():
            node = NODE.match(line)
            size = node and BYTES.search(node.group(2))
            if not size:
                continue  # a function of another file
            name = node.group(1).rsplit(":", 1)[-1]
            if size.group(2) != "static":
                raise Refused(f"{name}: a frame that is {size.group(2)}")
            frames[name] = max(frames.get(name, 0), int(size.group(1)))
    return frames


def count_registers(operands):
    """The bytes of a register list such as "r4, r5, lr" or "d8-d11"."""
    total = 0
    for part in REGISTERS.search(operands).group(1).split(","):
        ends = part.strip().split("-")
        width = 8 if ends[0][0] == "d" else 4
        first, last = (int(re.sub(r"\D", "", end) or 0) for end in (ends[0], ends[-1]))
        total += width * (last - first + 1)
    return total


def pushed(mnemonic, operands):
    """By how much an instruction lowers the stack pointer."""
    name = mnemonic.split(".")[0]
    if name in ("push", "vpush") or (name == "stmdb" and operands.startswith("sp!")):
        return count_registers(operands)
    if name in ("sub", "subw") and operands.startswith("sp"):
        return int(operands.rsplit("#", 1)[1]) if "#" in operands else 1 << 16
    lowered = re.search(r"\[sp, #-(\d+)\]!", operands)
    return int(lowered.group(1)) if lowered else 0


class CallGraph:
    def __init__(self, image, folder, declared):
        """`declared`: part of a demangled name to the bytes that the function behind its pointer may use."""
        self.calls = {}  # function to what it calls, its frame standing
        self.jumps = {}  # function to what it ends with, its frame gone
        self.indirect = {}  # function to calls through pointers
        self.lowered = {}  # function to bytes, by its instructions
        self.frames = stated_frames(folder)
        self.declared = declared
        self.read(image)
        self.names = demangled(self.calls)

    def read(self, image):
        text = subprocess.run(
            ["arm-none-eabi-objdump", "-d", "--no-show-raw-insn", image], capture_output=True, text=True, check=True
        ).stdout
        current = None
        for line in text.splitlines():
            function = FUNCTION.match(line)
            if function:
                current = self.whole(function.group(1))
                for table in (self.calls, self.jumps):
                    table.setdefault(current, set())
                self.lowered.setdefault(current, 0)
                self.indirect.setdefault(current, 0)
                continue
            parts = line.split("\t")
            if current and len(parts) >= 2 and not parts[1].startswith("."):
                self.take(current, parts[1].split()[0], (parts[2] if len(parts) > 2 else "").split(";")[0].strip())

    @staticmethod
    def whole(name):
        """A function's cold part belongs to it."""
        return re.sub(r"\.cold(\.\d+)?$", "", name)

    def take(self, current, mnemonic, operands):
        self.lowered[current] += pushed(mnemonic, operands)
        target = TARGET.search(operands)
        if mnemonic == "bl" and target and target.group(2):
            return  # a far jump within a function, on the cores that have no other
        if mnemonic in ("bl", "blx") and target:
            self.calls[current].add(self.whole(target.group(1)))
        elif mnemonic == "blx" or (mnemonic == "bx" and operands != "lr"):
            self.indirect[current] += 1
        elif BRANCH.match(mnemonic) and target and self.whole(target.group(1)) != current:
            self.jumps[current].add(self.whole(target.group(1)))

    def frame(self, function):
        return self.frames.get(function, self.lowered[function])

    def pointer_bound(self, function):
        """What calls through pointers of this function may use; the run-time library's `bx` of a register returns."""
        if not self.indirect[function] or function not in self.frames:
            return 0
        for part, bound in self.declared.items():
            if part in self.names[function]:
                return bound
        raise Refused(f"{self.names[function]}: a call through a pointer that is not declared")

    def stack(self, function, path=()):
        """The deepest stack of a function, in bytes."""
        if function in path:
            raise Refused("recursion: " + " -> ".join(self.names[name] for name in (*path, function)))
        path = (*path, function)
        own = self.frame(function)
        deepest = own + self.pointer_bound(function)
        for callee in self.calls[function]:
            deepest = max(deepest, own + self.stack(callee, path))
        # The library's own jumps leave its frame where it is.
        kept = 0 if function in self.frames else own
        for next_function in self.jumps[function]:
            deepest = max(deepest, kept + self.stack(next_function, path))
        return deepest

    def reached(self, function):
        """Every function that can run when this one is called, with the way to it."""
        ways = {function: (function,)}
        waiting = [function]
        while waiting:
            name = waiting.pop()
            for callee in self.calls[name] | self.jumps[name]:
                if callee not in ways:
                    ways[callee] = (*ways[name], callee)
                    waiting.append(callee)
        return ways
