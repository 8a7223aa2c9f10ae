"""Builds the programs of this folder for a variant (core and optimisation) and reads its figures.

instructions()  executed in each region, counted in QEMU by count_insns.c
flash()         by the object from which the linker took it
ram()           of the core's types
stack()         deepest stack of each function that a firmware calls from an interrupt
check_image()   what must not be in it
"""

import os
import re
import shlex
import subprocess
from pathlib import Path

from callgraph import CallGraph, Refused

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PREFIX = "arm-none-eabi-"

# Variant: core, the emulator's machine, optimisation.
VARIANTS = {
    "m4f-O2": ("cortex-m4", "mps2-an386", "-O2"),
    "m4f-Os": ("cortex-m4", "mps2-an386", "-Os"),
    "m0-O2": ("cortex-m0plus", "microbit", "-O2"),
    "m0-Os": ("cortex-m0plus", "microbit", "-Os"),
}

# Object to part. Whatever else is linked from the core's library belongs to the part of its own name.
PARTS = {
    "profile": "codec",
    "status": "codec",
    "errc": "codec",
    "servo_lock": "scheduler",
    "time": "scheduler",
    "plausibility": "position",
    "sample": "position",
    "link_health": "statistics",
    "position_tracker": "position",
    "axis_client": "axis",
}

# Calls through pointers on the way from an interrupt: the user's function, and the stack that it may use.
DECLARED = {"tm485::Axis<": 64, "tm485::ValidityLatch::on_lost": 64}

DIVISIONS = re.compile(r"^__(aeabi_u?ldivmod|u?divdi3|u?moddi3|u?divmoddi4)$")
LIBC_ALLOWED = {"memcpy", "memset", "memmove", "memcmp"}
MEMBER = re.compile(r"^ *\.(?:text|rodata|data|bss)\S*\s+0x[0-9a-f]+\s+0x([0-9a-f]+)\s+\S*/(lib[^/]+)\.a\(([^)]+)\)$", re.M)
PIECE = re.compile(r"^ \.(text|rodata|ARM|data|bss)\S*\s+0x([0-9a-f]+)\s+0x([0-9a-f]+) (\S+)$", re.M)
OBJECT = re.compile(r"([^/(]+?)(?:\.cpp)?\.(?:obj|o)\)?$")


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **options)
    if done.returncode != 0:
        raise Refused(f"{shlex.join(str(part) for part in command)}: {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def compiler():
    return run(PREFIX + "g++", "--version").splitlines()[0]


class Variant:
    def __init__(self, name, folder):
        self.name = name
        self.core, self.machine, self.level = VARIANTS[name]
        self.folder = folder / name
        self.programs = self.folder / "bench/firmware"

    def build(self):
        # Without the compiler cache, which does not keep the call graphs that the compiler writes beside the objects.
        quiet = {**os.environ, "CCACHE_DISABLE": "1"}
        toolchain = ROOT / "cmake/toolchains/arm-none-eabi.cmake"
        flags = f"{self.level} -DNDEBUG -fcallgraph-info=su"
        run(
            "cmake", "-S", ROOT, "-B", self.folder, "-G", "Ninja", "--toolchain", toolchain,
            f"-DTM485_ARM_CPU={self.core}", "-DCMAKE_BUILD_TYPE=Release", f"-DCMAKE_CXX_FLAGS_RELEASE={flags}",
            "-DTM485_WERROR=ON", env=quiet,
        )  # fmt: skip
        targets = ("tm485_cost_regions", "tm485_cost_parts", "tm485_cost_sizes")
        run("cmake", "--build", self.folder, "--target", *targets, env=quiet)

    def symbols(self, image):
        """Name to (address, size)."""
        found = {}
        for line in run(PREFIX + "nm", "-S", image).splitlines():
            fields = line.split()
            if len(fields) == 4:
                found[fields[3]] = (int(fields[0], 16), int(fields[1], 16))
        return found

    def run_regions(self, plugin):
        """One run in the emulator: region to the counts of its runs."""
        image = self.programs / "tm485_cost_regions"
        counts = self.programs / "counts.txt"
        symbols = self.symbols(image)
        marks = ",".join(f"{key}={symbols[name][0]:#x}" for key, name in (("begin", "region_begin"), ("end", "region_end")))
        names = self.programs / "names.txt"
        run(
            "qemu-system-arm", "-M", self.machine, "-kernel", image, "-display", "none", "-monitor", "none",
            "-serial", "none", "-chardev", f"file,id=names,path={names}",
            "-semihosting-config", "enable=on,target=native,chardev=names",
            "-plugin", f"file={plugin},{marks},out={counts}", timeout=60,
        )  # fmt: skip
        return names.read_text().split(), [int(line) for line in counts.read_text().split()]

    def instructions(self, plugin):
        """Region to the most instructions of its runs, without those of an empty region."""
        names, counts = self.run_regions(plugin)
        if (names, counts) != self.run_regions(plugin):
            raise Refused(f"{self.name}: two runs differ")
        if not names or len(names) != len(counts):
            raise Refused(f"{self.name}: {len(names)} regions ran, {len(counts)} were counted")
        most = {}
        for name, count in zip(names, counts):
            most[name] = max(most.get(name, 0), count)
        empty = most.pop("empty")
        return {name: count - empty for name, count in most.items()}

    def linked(self):
        """The map of the parts' image, a line for each piece."""
        text = (self.programs / "tm485_cost_parts.map").read_text()
        text = text.split("Linker script and memory map", 1)[1]
        return re.sub(r"^( \.\S+)\n +", r"\1 ", text, flags=re.M)

    def flash(self):
        parts = {}
        for kind, _, size, origin in PIECE.findall(self.linked()):
            if kind in ("data", "bss") and int(size, 16) != 0:
                raise Refused(f"{self.name}: static RAM in {origin}")
            stem = OBJECT.search(origin).group(1)
            library = "libgcc" in origin or "libc_nano" in origin
            part = "compiler and C library" if library else PARTS.get(stem, stem)
            parts[part] = parts.get(part, 0) + int(size, 16)
        parts["codec, scheduler, position, statistics"] = sum(
            parts[part] for part in ("codec", "scheduler", "position", "statistics")
        )
        return {part: size for part, size in sorted(parts.items()) if size != 0}

    def ram(self):
        sizes = self.programs / "CMakeFiles/tm485_cost_sizes.dir/sizes.cpp.obj"
        figures = {name.removeprefix("ram_"): size for name, (_, size) in self.symbols(sizes).items() if name.startswith("ram_")}
        figures["scheduler, position, statistics"] = sum(
            figures[part] for part in ("scheduler", "request_spacing", "position", "statistics")
        )
        return figures

    def graph(self):
        return CallGraph(self.programs / "tm485_cost_parts", self.folder, DECLARED)

    def stack(self):
        graph = self.graph()
        entries = sorted(name for name in graph.calls if name.startswith("part_isr_"))
        return {entry.removeprefix("part_isr_"): graph.stack(entry) for entry in entries}

    def check_image(self):
        """What is in the image and must not be there, one line each."""
        graph = self.graph()
        found = []
        for entry in (name for name in graph.calls if name.startswith("part_isr_")):
            for name, way in graph.reached(entry).items():
                if DIVISIONS.match(name):
                    found.append(f"64-bit division: {' -> '.join(graph.names[step] for step in way)}")
        for size, library, member in MEMBER.findall(self.linked()):
            base = re.sub(r"^lib_a-(.*?)(-[a-z]+)?\.o$", r"\1", member)
            if library == "libc_nano" and int(size, 16) != 0 and base not in LIBC_ALLOWED:
                found.append(f"of the C library: {member}")
        found += [f"atomic helper: {name}" for name in graph.calls if re.match(r"^__(atomic|sync)_", name)]
        return sorted(set(found))


def build_plugin(folder):
    folder.mkdir(parents=True, exist_ok=True)
    plugin = folder / "libcount_insns.so"
    warnings = ["-Wall", "-Wextra", "-Werror"]
    run("gcc", "-O2", *warnings, "-shared", "-fPIC", "-fvisibility=hidden", HERE / "count_insns.c", "-o", plugin)
    return plugin
