"""A simulated encoder and a machine in QEMU that reads it: processes with a bounded life, and the machine's console.

Nothing here judges; checks.py does."""

import os
import re
import select
import signal
import socket
import subprocess
import time

LONGEST_LIFE_S = 240
# In the foreground: otherwise it sends each signal twice, to the command and to its process group.
BOUNDED = ["timeout", "--foreground", str(LONGEST_LIFE_S)]


def allowed(*prefix):
    tried = subprocess.run([*prefix, "true"], stderr=subprocess.PIPE, check=False)
    return tried.returncode == 0 and not tried.stderr  # nice only complains


# On a busy machine a wait of 20 ms is soon too short, so these processes go before others where that is allowed. Not at
# a real-time priority: a machine whose program polls, because it would never let go of its processor.
POLITE = ["nice", "-n", "-20"] if allowed("nice", "-n", "-20") else []
AT_ONCE = ["chrt", "--rr", "1"] if allowed("chrt", "--rr", "1") else POLITE


class Failed(Exception):
    """What went wrong, for a line of the account."""


def end(process, how=signal.SIGTERM):
    """Ends a process that was started here, and waits for it."""
    if process.poll() is None:
        process.send_signal(how)
        try:
            process.wait(5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


class Encoder:
    """`tm485 sim --unix`, the encoder's end of the line."""

    def __init__(self, command, folder, *options):
        self.path = os.path.join(folder, "encoder")
        self.account = os.path.join(folder, "encoder.log")
        with open(self.account, "w") as account:
            self.process = subprocess.Popen(
                [*AT_ONCE, *BOUNDED, command, "sim", "--unix", self.path, *options],
                stdout=subprocess.PIPE,
                stderr=account,
                text=True,
            )
        self.since = time.monotonic()
        if not self.process.stdout.readline():
            raise Failed("the simulator did not start: " + self.ends())

    def ends(self):
        """Its own account: "tm485: N requests, M replies"."""
        end(self.process, signal.SIGINT)
        self.process.stdout.close()
        with open(self.account) as account:
            return account.read().strip()

    def abort(self):
        end(self.process)
        self.process.stdout.close()


class Machine:
    """QEMU with a program, its encoder on the first UART, its console, if it has one, on the second."""

    def __init__(self, board, program, folder, encoder=None, console=True, arguments=()):
        self.said = ""
        self.link = None
        path = os.path.join(folder, "console")
        semihosting = "enable=on,target=native,chardev=said"
        for argument in (os.path.basename(program), *arguments):
            semihosting += f",arg={argument}"
        line = [*(AT_ONCE if console else POLITE), *BOUNDED, "qemu-system-arm", "-M", board.machine, "-kernel", program]
        line += ["-display", "none", "-monitor", "none", "-chardev", "stdio,id=said,signal=off"]
        line += ["-semihosting-config", semihosting]
        if encoder:
            # With a console the encoder may come and go: QEMU tries again each second. Without, it is there from the start.
            again = ",reconnect=1" if console else ""
            line += ["-chardev", f"socket,id=encoder,path={encoder.path}{again}", "-serial", "chardev:encoder"]
        listener = None
        if console:
            listener = socket.socket(socket.AF_UNIX)
            listener.bind(path)
            listener.listen(1)
            listener.settimeout(20)
            line += ["-chardev", f"socket,id=console,path={path}", "-serial", "chardev:console"]
        self.process = subprocess.Popen(
            line,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        if listener:
            try:
                self.link, _ = listener.accept()
            except TimeoutError:
                self.abort()
                raise Failed("QEMU did not open its console") from None
            finally:
                listener.close()

    def read(self, seconds):
        """What comes within this time, at most; "" if nothing does."""
        ready, _, _ = select.select([self.link], [], [], seconds)
        if not ready:
            return ""
        text = self.link.recv(65536).decode(errors="replace")
        if not text:
            raise Failed("the console was closed; the machine's exit code is " + str(self.exit_code()))
        self.said += text
        return text

    def wait_for(self, pattern, seconds):
        """Reads until the pattern is found in what has come since the last command, and answers the match."""
        last = time.monotonic() + seconds
        while not (found := re.search(pattern, self.said)):
            left = last - time.monotonic()
            if left <= 0:
                raise Failed(f"no {pattern!r} on the console within {seconds} s, but {self.said[-300:]!r}")
            self.read(left)
        return found

    def ask(self, command, pattern=r"(?m)^ok$", seconds=20):
        """A command and its answer; the node ends each answer with a line "ok" or "error: ..."."""
        self.said = ""
        self.link.sendall((command + "\n").encode())
        return self.wait_for(pattern, seconds)

    def exit_code(self, seconds=20):
        try:
            self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.abort()
            raise Failed("the machine did not end") from None
        self.output = self.process.stdout.read()
        self.close()
        return self.process.returncode

    def close(self):
        if self.link:
            self.link.close()
            self.link = None
        if not self.process.stdout.closed:
            self.process.stdout.close()

    def abort(self):
        end(self.process)
        self.close()
