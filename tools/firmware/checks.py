"""What is asked of each firmware example while it runs, and what is a good answer. Each scenario is a function that
raises Failed; what it answers goes into the table."""

import os
import random
import re
import time
from typing import NamedTuple

from machine import Encoder, Failed, Machine

CYCLES = 2000
RPM = 60
COUNTS_PER_SECOND = 131072 * RPM // 60
EEPROM_BYTES = 7 * 127
PATIENCE_S = 120
VECTORS = 70

POSITION = (
    r"position (?P<position>-?\d+) counts, velocity (?P<velocity>-?\d+) counts/s, turn (?P<turn>-?\d+), "
    r"(?P<validity>\w+), age (?P<age>-?\d+) us, at (?P<at>\d+) us"
)


class Pace(NamedTuple):
    """What a machine is told at its start."""

    period_ns: int
    allowance_ns: int

    def words(self):
        return str(self.period_ns), str(self.allowance_ns)


# For each attempt at a run without faults. A host that is late for 20 ms is rarely so for half a second; a byte that the
# program loses is lost for any allowance. So the last attempt tells one from the other.
PACES = (Pace(5_000_000, 20_000_000), Pace(5_000_000, 100_000_000), Pace(10_000_000, 500_000_000))


class HostWasLate(Failed):
    """Cycles failed without a fault: as a rule a host that left a machine alone for longer than the allowance."""


def check(condition, what):
    if not condition:
        raise Failed(what)


def near(value, wanted, tolerance, what, kind=Failed):
    if abs(value - wanted) > tolerance:
        raise kind(f"{what} is {value:.0f}, and not {wanted:.0f} within {tolerance:.0f}")


def near_speed(value, share, what):
    near(value, COUNTS_PER_SECOND, share * COUNTS_PER_SECOND, what, HostWasLate)


def position(machine):
    found = machine.ask("position", POSITION)
    machine.wait_for(r"(?m)^ok$", 5)
    answer = {key: found[key] if key == "validity" else int(found[key]) for key in found.groupdict()}
    answer["text"] = machine.said
    return answer


def statistics(machine):
    machine.ask("statistics")
    return {name: int(value) for name, value in re.findall(r"(?m)^(\w+) (-?\d+)$", machine.said)}


def errors(machine):
    """By name, with the count; each has to state cause and remedy."""
    machine.ask("errors")
    found = re.findall(r"(?m)^(\d+) (\w+): (.+); (.+)$", machine.said)
    lines = [line for line in machine.said.splitlines() if re.match(r"\d", line)]
    check(len(lines) == len(found), f"an error without cause or remedy: {machine.said!r}")
    return {name: int(count) for count, name, _, _ in found}


def run_until(machine, condition, what):
    """Statistics, once they are as wanted."""
    last = time.monotonic() + PATIENCE_S
    while not condition(counted := statistics(machine)):
        check(time.monotonic() < last, f"{what} did not come about within {PATIENCE_S} s: {counted}")
        time.sleep(0.25)
    return counted


def start(machine, pace):
    machine.wait_for("help lists the commands", 20)
    machine.ask("start " + " ".join(pace.words()))


def motion(machine, encoder, resume=False):
    """Position and velocity against the motion that the simulator was told. With `resume` a loss is an operator's affair.
    Seconds in which the host was late are measured again: they look like a shaft that jerks."""
    last = time.monotonic() + 20
    while True:
        try:
            return motion_of_a_second(machine, encoder, resume, last)
        except HostWasLate:
            lost = "'resume' when it may go on" in machine.said
            if time.monotonic() > last or (lost and not resume):
                raise


def motion_of_a_second(machine, encoder, resume, last):
    while (first := position(machine))["validity"] == "invalid":
        lost = "'resume' when it may go on" in first["text"]
        if time.monotonic() > last or (lost and not resume):
            raise HostWasLate(f"no valid position: {first}")
        if lost:
            machine.ask("resume")
        time.sleep(0.1)
    time.sleep(1)
    second = position(machine)
    passed = time.monotonic() - encoder.since
    if second["validity"] == "invalid":
        raise HostWasLate(f"the position became invalid: {second}")
    moved = (second["position"] - first["position"]) / ((second["at"] - first["at"]) * 1e-6)
    near_speed(moved, 0.03, "the speed by two positions")
    near_speed(second["velocity"], 0.15, "the velocity")
    near(second["position"], COUNTS_PER_SECOND * passed, 0.5 * COUNTS_PER_SECOND, "the position", HostWasLate)
    near(second["turn"], 1 + second["position"] // 131072, 1, "the turn count, which begins with 1")


def bad_input(machine):
    """Each refused with its reason, and nothing of it happens."""
    machine.wait_for("help lists the commands", 20)
    for command, reason in (
        ("bogus", "no command 'bogus'; help lists them"),
        ("x" * 60, "a line has at most 47 characters"),
        ("position", "not started; 'start' begins"),
        ("start soon", "'soon' is no whole number of nanoseconds"),
        ("start 99999999999", "'99999999999' is no whole number of nanoseconds"),
        ("start 50000 4000", "refused, period_below_t1"),
        ("start 900", "refused, "),
    ):
        machine.ask(command, r"(?m)^error: .*\n")
        check(f"error: {reason}" in machine.said, f"{command!r} was answered {machine.said!r}")
    machine.ask("start 50000 4000", r"nearest possible: 62500 ns\n")
    machine.ask("help")
    for command in ("start", "position", "statistics", "errors", "eeprom", "resume", "quit"):
        check(re.search(rf"(?m)^{command}  .", machine.said), f"help does not tell of {command}")


def eeprom(machine, contents):
    machine.ask("eeprom")
    machine.ask("eeprom", r"(?m)^(error: it is being read|eeprom: \d+ bytes)$")
    machine.wait_for(r"(?m)^eeprom: 889 bytes$", PATIENCE_S)
    dumped = bytes.fromhex("".join(re.findall(r"(?m)^((?:[0-9A-F]{2})+)$", machine.said)))
    check(len(dumped) == len(contents), f"the dump has {len(dumped)} bytes")
    wrong = [address for address in range(EEPROM_BYTES) if dumped[address] != contents[address]]
    check(not wrong, f"the dump is not what the simulator's EEPROM file has, at {wrong}")


def leave(machine):
    machine.link.sendall(b"quit\n")
    code = machine.exit_code()
    check(code == 0, f"the exit code is {code}")


def clean_run(board, program, command, folder, pace):
    """No faults: bad input, 2000 cycles, motion, EEPROM."""
    contents = random.Random(485).randbytes(EEPROM_BYTES)
    file = os.path.join(folder, "eeprom.bin")
    with open(file, "wb") as out:
        out.write(contents)
    encoder = Encoder(command, folder, "--rpm", str(RPM), "--eeprom", file, "--eeprom-page", "1ms")
    machine = None
    try:
        machine = Machine(board, program, folder, encoder)
        bad_input(machine)
        start_again = "start " + " ".join(pace.words())
        machine.ask(start_again)
        machine.ask(start_again, r"(?m)^error: refused, busy: ")
        motion(machine, encoder)
        eeprom(machine, contents)
        counted = run_until(machine, lambda now: now["cycles"] >= CYCLES, f"{CYCLES} cycles")
        seen = errors(machine)
        if counted["failed"] != 0 or seen:
            raise HostWasLate(f"{counted['failed']} failed cycles, errors {seen}")
        near(counted["good"], counted["cycles"], 1, "the number of good cycles")
        # Replies that only the deadline brings in, because an interrupt stays away, would not fail otherwise.
        if counted["t1_mean_ns"] > 2 * pace.period_ns:
            raise HostWasLate(f"T1 is {counted['t1_mean_ns']} ns in the mean, at a period of {pace.period_ns} ns")
        check(counted["startups"] == 1 and counted["invalidated"] == 0, f"the encoder was lost: {counted}")
        check(counted["control_fresh"] > 0, f"the control loop has seen no fresh sample: {counted}")
        motion(machine, encoder)
        leave(machine)
        return counted["cycles"], counted["good"], f"T1 {counted['t1_mean_ns'] / 1e6:.2f} ms, EEPROM 889 bytes equal"
    finally:
        if machine:
            machine.abort()
        encoder.abort()


def faulty_run(board, program, command, folder, pace):
    """Lost replies and wrong bits, then a restart of the encoder."""
    machine = other = None
    encoder = Encoder(command, folder, "--rpm", str(RPM), "--lost", "0.005", "--ber", "0:1e-4", "--seed", "7")
    try:
        machine = Machine(board, program, folder, encoder)
        start(machine, pace)
        motion(machine, encoder, resume=True)
        counted = run_until(
            machine, lambda now: now["cycles"] >= CYCLES // 2 and now["failed"] >= 10, "1000 cycles, 10 of them failed"
        )
        seen = errors(machine)
        check(seen.get("timeout", 0) > 0, f"lost replies are not counted as timeouts: {seen}")
        check(seen.get("crc_error", 0) > 0, f"wrong bits are not counted as CRC errors: {seen}")
        check(counted["good"] > 0 and abs(counted["good"] + counted["failed"] - counted["cycles"]) <= 1, str(counted))
        account = encoder.ends()
        check(re.search(r"[1-9]\d* lost, [1-9]\d* bits wrong", account), f"the simulator says: {account}")

        # The encoder is gone: torque off, and it stays so until a command.
        run_until(machine, lambda now: now["lost"] > counted["lost"], "the loss of the encoder")
        gone = position(machine)
        check(gone["validity"] == "invalid" and "'resume' when it may go on" in gone["text"], f"not invalid: {gone}")
        other = Encoder(command, folder, "--rpm", str(RPM), "--boot", "200ms")
        back = run_until(machine, lambda now: now["startups"] > counted["startups"], "a start-up")
        still = position(machine)
        check(still["validity"] == "invalid", f"valid again without a command: {still}")
        machine.ask("resume")
        motion(machine, other, resume=True)
        run_until(machine, lambda now: now["good"] >= back["good"] + 100, "100 good cycles after the restart")
        leave(machine)
        return counted["cycles"], counted["good"], ", ".join(f"{n} {name}" for name, n in seen.items())
    finally:
        if machine:
            machine.abort()
        encoder.abort()
        if other:
            other.abort()


def account_of(machine):
    """What `minimal` has printed at its end: its positions, its counts, its errors by name."""
    positions = [
        {key: int(value) for key, value in found.groupdict().items()}
        for found in re.finditer(
            r"(?m)^position (?P<position>-?\d+) counts, velocity (?P<velocity>-?\d+) counts/s, turn (?P<turn>-?\d+), "
            r"valid, at (?P<at>\d+) us$",
            machine.output,
        )
    ]
    counts = re.search(r"(?m)^cycles (\d+), good (\d+), failed (\d+), lost (\d+)$", machine.output)
    check(counts, f"no account: {machine.output!r}")
    seen = {name: int(count) for count, name in re.findall(r"(?m)^(\d+) (\w+)$", machine.output)}
    return positions, [int(count) for count in counts.groups()], seen


def minimal_run(board, program, command, folder, pace, faults=()):
    encoder = Encoder(command, folder, "--rpm", str(RPM), *faults)
    machine = None
    try:
        arguments = (*pace.words(), str(CYCLES))
        machine = Machine(board, program, folder, encoder, console=False, arguments=arguments)
        code = machine.exit_code(PATIENCE_S)
        positions, (cycles, good, failed, lost), seen = account_of(machine)
        check(cycles == CYCLES and good + failed == cycles, f"the counts do not add up: {machine.output!r}")
        # Not the errors before the first good cycle: after power-up QEMU leaves the UART of this machine alone until
        # something else wakes it, up to a second.
        if not faults and (failed or lost or len(positions) != CYCLES // 500):
            raise HostWasLate(f"{failed} failed cycles, errors {seen}")
        check(code == 0, f"the exit code is {code}: {machine.output!r}")
        check(len(positions) >= 2, f"fewer than two valid positions: {machine.output!r}")
        first, last = positions[0], positions[-1]
        moved = (last["position"] - first["position"]) / ((last["at"] - first["at"]) * 1e-6)
        near_speed(moved, 0.03, "the speed by two positions")
        near_speed(last["velocity"], 0.15, "the velocity")
        near(last["turn"], 1 + last["position"] // 131072, 1, "the turn count, which begins with 1")
        return cycles, good, seen
    finally:
        if machine:
            machine.abort()
        encoder.abort()


def minimal_clean_run(board, program, command, folder, pace):
    """No faults; before that, a command line that is none, and a period that the protocol forbids."""
    for arguments, answer in (
        (("soon",), "error: usage: minimal [PERIOD_NS [ALLOWANCE_NS [CYCLES]]]"),
        (("50000", "4000"), "error: refused, period_below_t1; nearest possible: 62500 ns"),
    ):
        machine = Machine(board, program, folder, console=False, arguments=arguments)
        try:
            code = machine.exit_code()
            check(code == 2 and answer in machine.output, f"{arguments} was answered {code}: {machine.output!r}")
        finally:
            machine.abort()
    cycles, good, _ = minimal_run(board, program, command, folder, pace)
    return cycles, good, "0 failed"


def minimal_faulty_run(board, program, command, folder, pace):
    faults = ("--lost", "0.005", "--ber", "0:1e-4", "--seed", "7")
    cycles, good, seen = minimal_run(board, program, command, folder, pace, faults)
    check(seen.get("timeout", 0) > 0, f"lost replies are not counted as timeouts: {seen}")
    check(seen.get("crc_error", 0) > 0, f"wrong bits are not counted as CRC errors: {seen}")
    return cycles, good, ", ".join(f"{count} {name}" for name, count in seen.items())


def vectors_run(board, program, command, folder, _):
    """The golden vectors, judged on the core itself."""
    machine = Machine(board, program, folder, console=False)
    try:
        code = machine.exit_code(60)
        found = re.search(r"(?m)^(\d+) vectors, (\d+) failed$", machine.output)
        check(found, f"no account: {machine.output!r}")
        check(code == 0 and found[2] == "0", f"exit code {code}: {machine.output!r}")
        check(int(found[1]) == VECTORS, f"{found[1]} vectors, and not {VECTORS}")
        return "", "", f"{found[1]} vectors"
    finally:
        machine.abort()
