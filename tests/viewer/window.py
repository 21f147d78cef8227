"""A real window on a display that nobody sees, driven as a person would: for `tests/viewer/check-window` and `benches/viewer/measure-latency`.

Xvfb is the display, xdotool the hands, ImageMagick's `import` the eyes, and the lines of `kiln view --trace` say what happened and
where things are. Nothing but Python's own library.
"""

import ctypes
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import urllib.parse
import zlib

WIDTH, HEIGHT = 1600, 1200

PACKAGES = {"Xvfb": "xvfb", "xdotool": "xdotool", "import": "imagemagick", "convert": "imagemagick"}


def need_programs():
    missing = sorted({package for program, package in PACKAGES.items() if not shutil.which(program)})
    if missing:
        sys.exit(f"not there: apt-get install {' '.join(missing)} libgl1-mesa-dri")


def kiln_command():
    """The command that is tested: $KILN, or that of the last release build."""
    built = os.environ.get("CARGO_TARGET_DIR", "target")
    kiln = os.path.abspath(os.environ.get("KILN", os.path.join(built, "release", "kiln")))
    if not os.access(kiln, os.X_OK):
        subprocess.run(["cargo", "build", "--release"], check=True)
    return kiln


class Display:
    """An X server with a screen in memory, and OpenGL by Mesa in software."""

    def __init__(self, width=WIDTH, height=HEIGHT):
        read, write = os.pipe()
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{width}x{height}x24", "-nolisten", "tcp"],
            pass_fds=[write],
            stderr=subprocess.DEVNULL,
        )
        os.close(write)
        with os.fdopen(read) as numbers:
            number = numbers.readline().strip()
        if not number:
            sys.exit("Xvfb did not start")
        self.name = f":{number}"
        self.home = tempfile.mkdtemp(prefix="kiln-home-")
        self.environment = dict(os.environ, DISPLAY=self.name, LIBGL_ALWAYS_SOFTWARE="1", HOME=self.home)
        for name in ["WAYLAND_DISPLAY", "WAYLAND_SOCKET", "XDG_DATA_HOME", "XDG_CONFIG_HOME", "XAUTHORITY"]:
            self.environment.pop(name, None)

    def run(self, *command):
        return subprocess.run(command, env=self.environment, check=True, capture_output=True).stdout

    def close(self):
        self.server.terminate()
        self.server.wait()
        shutil.rmtree(self.home, ignore_errors=True)


class ClientMessage(ctypes.Structure):
    _fields_ = [("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("send_event", ctypes.c_int), ("display", ctypes.c_void_p)]
    _fields_ += [("window", ctypes.c_ulong), ("message_type", ctypes.c_ulong), ("format", ctypes.c_int), ("data", ctypes.c_long * 5)]


class Selection(ctypes.Structure):
    """A request for a selection (with its owner first), or the answer to it (without)."""

    _fields_ = [("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("send_event", ctypes.c_int), ("display", ctypes.c_void_p)]
    _fields_ += [("windows", ctypes.c_ulong * 2), ("names", ctypes.c_ulong * 4)]


class Event(ctypes.Union):
    _fields_ = [("type", ctypes.c_int), ("message", ClientMessage), ("selection", Selection), ("pad", ctypes.c_long * 24)]


class Files:
    """Files dragged from a file manager: the other side of the protocol XDND, version 5, which xdotool does not speak."""

    SELECTION_REQUEST, SELECTION_NOTIFY, CLIENT_MESSAGE = 30, 31, 33

    def __init__(self, display):
        self.x = ctypes.CDLL("libX11.so.6")
        for name, result in [("XOpenDisplay", ctypes.c_void_p), ("XDefaultRootWindow", ctypes.c_ulong)]:
            getattr(self.x, name).restype = result
        self.x.XInternAtom.restype = self.x.XCreateSimpleWindow.restype = ctypes.c_ulong
        self.display = ctypes.c_void_p(self.x.XOpenDisplay(display.name.encode()))
        root = ctypes.c_ulong(self.x.XDefaultRootWindow(self.display))
        self.own = ctypes.c_ulong(self.x.XCreateSimpleWindow(self.display, root, 0, 0, 1, 1, 0, *[ctypes.c_ulong(0)] * 2))

    def atom(self, name):
        return self.x.XInternAtom(self.display, name.encode(), 0)

    def send(self, window, kind, *data):
        event = Event()
        event.message.type, event.message.format = self.CLIENT_MESSAGE, 32
        event.message.window, event.message.message_type = window, self.atom(kind)
        event.message.data = (ctypes.c_long * 5)(self.own.value, *data)
        self.x.XSendEvent(self.display, ctypes.c_ulong(window), 0, ctypes.c_long(0), ctypes.byref(event))
        self.x.XFlush(self.display)

    def answer(self, event, files):
        """Hands over the names of the files."""
        text = "".join(f"file://{urllib.parse.quote(file)}\r\n" for file in files).encode()
        _, requestor = event.selection.windows
        selection, target, name, at = event.selection.names
        self.x.XChangeProperty(
            self.display, *[ctypes.c_ulong(value) for value in (requestor, name, target)], 8, 0, text, len(text)
        )
        reply = Event()
        reply.selection.type = self.SELECTION_NOTIFY
        reply.selection.windows = (ctypes.c_ulong * 2)(requestor, selection)
        reply.selection.names = (ctypes.c_ulong * 4)(target, name, at, 0)
        self.x.XSendEvent(self.display, ctypes.c_ulong(requestor), 0, ctypes.c_long(0), ctypes.byref(reply))
        self.x.XFlush(self.display)

    def drop(self, window, files, x, y, seconds=5):
        """Drags files over a place of the screen that belongs to a window, and lets go of them."""
        self.x.XSetSelectionOwner(self.display, ctypes.c_ulong(self.atom("XdndSelection")), self.own, ctypes.c_ulong(0))
        self.send(window, "XdndEnter", 5 << 24, self.atom("text/uri-list"), 0, 0)
        self.send(window, "XdndPosition", 0, x << 16 | y, 0, self.atom("XdndActionCopy"))
        event, deadline, dropped = Event(), time.monotonic() + seconds, False
        while time.monotonic() < deadline:
            if not self.x.XPending(self.display):
                time.sleep(0.01)
                continue
            self.x.XNextEvent(self.display, ctypes.byref(event))
            if event.type == self.SELECTION_REQUEST:
                self.answer(event, files)
            elif event.type == self.CLIENT_MESSAGE and event.message.message_type == self.atom("XdndStatus"):
                if event.message.data[1] & 1 and not dropped:
                    self.send(window, "XdndDrop", 0, 0, 0, 0)
                    dropped = True
            elif event.type == self.CLIENT_MESSAGE and event.message.message_type == self.atom("XdndFinished"):
                return
        raise Timeout("the window does not take the files" if dropped else "the window does not want the files")


class Timeout(Exception):
    """What was waited for did not happen."""


class Window:
    """`kiln view` on a display."""

    def __init__(self, display, kiln, inputs, *options, cwd=None):
        self.display = display
        self.folder = tempfile.mkdtemp(prefix="kiln-window-")
        self.trace = os.path.join(self.folder, "trace")
        open(self.trace, "w").close()
        self.read = 0
        self.rest = b""
        self.events = []
        self.places = {}
        self.said = open(os.path.join(self.folder, "said"), "w+")
        self.process = subprocess.Popen(
            [kiln, "view", *inputs, "--trace", self.trace, *options],
            env=display.environment,
            stdout=self.said,
            stderr=subprocess.STDOUT,
            cwd=cwd,
        )
        self.wait("started", seconds=60)
        found = display.run("xdotool", "search", "--sync", "--onlyvisible", "--pid", str(self.process.pid))
        self.id = found.split()[-1].decode()
        # There is no window manager to do these.
        self.move_to_front()
        display.run("xdotool", "windowfocus", "--sync", self.id)

    def move_to_front(self):
        self.display.run("xdotool", "windowmove", "--sync", self.id, "0", "0")

    def resize_canvas(self, width, height):
        """Makes the window so large that the picture has this size."""
        whole = self.display.run("xdotool", "getwindowgeometry", "--shell", self.id).decode()
        whole = dict(line.split("=") for line in whole.split())
        _, _, own_width, own_height = self.canvas()
        more = width - own_width, height - own_height
        self.display.run(
            "xdotool", "windowsize", self.id, str(int(whole["WIDTH"]) + more[0]), str(int(whole["HEIGHT"]) + more[1])
        )

    # What happened.

    def poll(self):
        """Reads what the window has said since."""
        with open(self.trace, "rb") as lines:
            lines.seek(self.read)
            new = lines.read()
        self.read += len(new)
        *whole, self.rest = (self.rest + new).split(b"\n")
        for line in whole:
            event = json.loads(line)
            self.events.append(event)
            if event["event"] == "place":
                self.places[event["name"]] = event["rect"]
        return len(self.events)

    def wait(self, kind, after=0, seconds=30, **values):
        """The first event of a kind, from event number `after` on, that has these values."""
        deadline = time.monotonic() + seconds
        while True:
            self.poll()
            for event in self.events[after:]:
                if event["event"] == kind and all(event.get(key) == value for key, value in values.items()):
                    return event
            if self.process.poll() is not None:
                self.said.seek(0)
                raise Timeout(f"the window closed ({self.process.returncode}): {self.said.read().strip()}")
            if time.monotonic() > deadline:
                raise Timeout(f"no `{kind}` with {values} in {seconds} s")
            time.sleep(0.005)

    def last(self, kind):
        self.poll()
        return next((event for event in reversed(self.events) if event["event"] == kind), None)

    def settle(self, after=None, seconds=60, quiet=0.3):
        """Waits until the last order is finished and no other comes; with `after`, there has to be an order from there on."""
        if after is not None:
            self.wait("order", after, seconds)
        deadline = time.monotonic() + seconds
        while True:
            order = self.last("order")
            done = order and any(
                event["event"] == "picture" and event["order"] == order["order"] and event["last"]
                for event in reversed(self.events)
            )
            if done and time.clock_gettime(time.CLOCK_MONOTONIC) - self.events[-1]["t"] > quiet:
                return order
            if self.process.poll() is not None:
                self.said.seek(0)
                raise Timeout(f"the window closed ({self.process.returncode}): {self.said.read().strip()}")
            if time.monotonic() > deadline:
                raise Timeout(f"order {order} is not finished after {seconds} s")
            time.sleep(0.02)

    # Hands.

    def key(self, *keys):
        self.display.run("xdotool", "key", "--clearmodifiers", *keys)

    def hold(self, key, seconds):
        self.display.run("xdotool", "keydown", key, "sleep", str(seconds), "keyup", key)

    def place(self, name):
        """The middle of what can be clicked."""
        self.poll()
        if name not in self.places:
            raise Timeout(f"there is no `{name}` to click; there are {', '.join(sorted(self.places))}")
        x, y, width, height = self.places[name]
        return x + width // 2, y + height // 2

    def move(self, x, y):
        self.display.run("xdotool", "mousemove", str(x), str(y), "sleep", "0.05")

    def away(self):
        """Takes the mouse out of the window, so that nothing is lit up or explained."""
        self.move(WIDTH - 1, HEIGHT - 1)

    def click(self, x, y, button=1):
        # Sooner, it would be the second half of a double click, wherever the first one was.
        time.sleep(0.35)
        self.move(x, y)
        self.display.run("xdotool", "mousedown", str(button), "sleep", "0.05", "mouseup", str(button))

    def press(self, name):
        self.click(*self.place(name))

    def drag(self, start, end, button=1, keys=()):
        steps = [part for key in keys for part in ("keydown", key)]
        steps += ["mousemove", *map(str, start), "sleep", "0.05", "mousedown", str(button), "sleep", "0.05"]
        for i in range(1, 11):
            x, y = (round(a + (b - a) * i / 10) for a, b in zip(start, end))
            steps += ["mousemove", str(x), str(y), "sleep", "0.02"]
        steps += ["sleep", "0.05", "mouseup", str(button)]
        steps += [part for key in keys for part in ("keyup", key)]
        self.display.run("xdotool", *steps)

    def wheel(self, x, y, clicks):
        self.move(x, y)
        self.display.run("xdotool", "click", "--repeat", str(abs(clicks)), "--delay", "30", "4" if clicks > 0 else "5")

    # Eyes.

    def screenshot(self, file):
        self.display.run("import", "-window", "root", f"png24:{file}")

    def canvas(self):
        """Where the picture is on the screen: x, y, width, height."""
        self.poll()
        return self.places["canvas"]

    def close(self):
        self.process.terminate()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.said.close()
        shutil.rmtree(self.folder, ignore_errors=True)


def pixels(file, crop=None):
    """Width, height and bytes of a picture or a part of it: x, y, width, height."""
    command = ["convert", file]
    if crop:
        x, y, width, height = crop
        command += ["-crop", f"{width}x{height}+{x}+{y}", "+repage"]
    raw = subprocess.run([*command, "-depth", "8", "ppm:-"], check=True, capture_output=True).stdout
    _, size, _, data = raw.split(b"\n", 3)
    width, height = map(int, size.split())
    return width, height, data


def apart(a, b):
    """How far two pictures are apart: the share of bytes that differ, and the largest difference."""
    if a[:2] != b[:2]:
        raise ValueError(f"pictures of {a[0]} x {a[1]} and {b[0]} x {b[1]}")
    if a[2] == b[2]:
        return 0.0, 0
    differences = [abs(x - y) for x, y in zip(a[2], b[2])]
    return sum(map(bool, differences)) / len(differences), max(differences)


def layers(file):
    """The channels of an OpenEXR picture of 32-bit floats, uncompressed or by ZIP: names and rows of numbers."""
    data = open(file, "rb").read()
    at = 8
    header = {}

    def text():
        nonlocal at
        end = data.index(b"\0", at)
        found, at = data[at:end].decode(), end + 1
        return found

    while name := text():
        text()
        (length,) = struct.unpack_from("<i", data, at)
        header[name] = data[at + 4 : at + 4 + length]
        at += 4 + length
    names, rest = [], header["channels"]
    while rest[0]:
        name, rest = rest.split(b"\0", 1)
        if struct.unpack_from("<i", rest)[0] != 2:
            raise ValueError(f"{name} is not of 32-bit floats")
        names.append(name.decode())
        rest = rest[16:]
    left, top, right, bottom = struct.unpack("<4i", header["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    compression = header["compression"][0]
    rows_a_block = {0: 1, 2: 1, 3: 16}[compression]
    blocks = -(-height // rows_a_block)
    found = {name: [] for name in names}
    for (offset,) in struct.iter_unpack("<Q", data[at : at + 8 * blocks]):
        y, length = struct.unpack_from("<2i", data, offset)
        rows = min(rows_a_block, bottom + 1 - y)
        block = data[offset + 8 : offset + 8 + length]
        if length < rows * width * len(names) * 4:
            raw = bytearray(zlib.decompress(block))
            for i in range(1, len(raw)):
                raw[i] = (raw[i - 1] + raw[i] - 128) & 255
            half = (len(raw) + 1) // 2
            block = bytearray(len(raw))
            block[0::2], block[1::2] = raw[:half], raw[half:]
        values = struct.unpack(f"<{rows * width * len(names)}f", block)
        for row in range(rows):
            for i, name in enumerate(names):
                start = (row * len(names) + i) * width
                found[name].append(values[start : start + width])
    return found
