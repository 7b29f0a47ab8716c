"""One camera of `hour.py`: the server that misbehaves as told, with faults of its own, and a ledger of all that it sends.

    watched.py FOLDER PORT OPTIONS LEDGER

FOLDER has `rtspodd.py`, whose text is run as it is but for its last line, which would start it; OPTIONS are its own, as JSON, and:

    x_name    "camera/episode", which stands in every frame          x_lose    share of frames that lose a packet
    x_start   access unit of the file that comes first               x_damage  share of frames of which a packet is damaged
    x_busy    seconds for which it answers 503                       x_swap    share of frames of which two packets change places
    x_cut     number of the frame amid which the connection is reset

Every frame gets an SEI message with its name: camera, episode, connection, number. The ledger has a line, a list in JSON, for

    "frame"   time, connection, number, whether it is a key frame, digest of its slices: before its first packet is sent
    "done"    connection, number, what became of it: whole, lost, damaged, cut (amid it the connection ended), omitted
    "bye"     time, connection, who ended it: server or daemon
"""
import ctypes
import hashlib
import json
import os
import random
import re
import sys
import threading
import time
import types

MARK = b"videofields-hour"  # 16 bytes, as the SEI message wants
NAME = re.compile(MARK + rb"/(\d+)/(\d+)/(\d+)/(\d+);")


def is_slice(nal, is_hevc):
    """Tells whether a NAL unit holds a part of a picture."""
    return (nal[0] >> 1) & 63 < 32 if is_hevc else nal[0] & 31 in (1, 5)


def is_key(nal, is_hevc):
    """Tells whether decoding can begin with the picture of that slice."""
    return 16 <= (nal[0] >> 1) & 63 <= 23 if is_hevc else nal[0] & 31 == 5


def digest(slices):
    """Tells pictures apart by their slices: headers beside them may come and go."""
    return hashlib.blake2b(b"".join(slices), digest_size=8).hexdigest()


def named(unit, name, is_hevc):
    """Returns an access unit with its name before its first slice, and the place of that slice before."""
    at = next(at for at, nal in enumerate(unit) if is_slice(nal, is_hevc))
    text = b"%s/%s;" % (MARK, name.encode())
    head = bytes([39 << 1, 1]) if is_hevc else bytes([6])
    return [*unit[:at], head + bytes([5, len(text)]) + text + b"\x80", *unit[at:]], at


def load(path, arguments):
    """Returns the server's module, not started."""
    server = types.ModuleType("rtspodd")
    server.__file__, sys.argv = path, [path, *arguments]
    with open(path, encoding="utf-8") as file:
        exec(compile(file.read().rstrip().removesuffix("main()"), path, "exec"), server.__dict__)
    return server


def serve(folder, port, options, ledger):
    """Runs the server with connections that are watched, for ever."""
    server = load(os.path.join(folder, "rtspodd.py"), [port, options])
    options = json.loads(options)
    is_hevc, began, here, lock = options.get("hevc", False), time.time(), threading.local(), threading.Lock()
    numbers = iter(range(1, 1 << 30))
    ledger = open(ledger, "a", encoding="utf-8")

    def note(*what):
        with lock:
            ledger.write(json.dumps(what) + "\n")
            ledger.flush()

    def log(*what):
        client = getattr(here, "client", None) or threading.current_thread()
        if str(what[0]).split(":")[0] in ("dies", "SESSION TIMEOUT", "GET_PARAMETER kills"):
            client.is_ended_here = True
        print(f"{time.time():.3f}", *what, flush=True)

    class Endless:
        """A file's access units for ever, as the server's loop takes them: by the number of the frame."""

        def __init__(self, units):
            self.units = units

        def __len__(self):
            return sys.maxsize

        def __getitem__(self, n):
            return here.client.begin_frame(n, self.units[(n + options.get("x_start", 0)) % len(self.units)])

    class Watched(server.Client):
        number, is_ended_here = 0, False
        frame = None  # number of the frame that is being sent, and what became of it
        held = None  # packet that another one overtakes

        def request(self, head):
            is_busy = time.time() - began < options.get("x_busy", 0)
            server.O["status"] = "503 Service Unavailable" if is_busy else None
            super().request(head)

        def run(self):
            super().run()
            note("bye", time.time(), self.number, "server" if self.is_ended_here else "daemon")

        def stream(self):
            here.client, self.number = self, next(numbers)
            self.chance = random.Random(f"{options['x_name']}/{self.number}")
            super().stream()
            self.end_frame()

        def begin_frame(self, n, unit):
            self.end_frame()
            self.frame, self.n_packets = [n, "omitted"], 0
            unit, at = named(unit, f"{options['x_name']}/{self.number}/{n}", is_hevc)
            slices = [nal for nal in unit if is_slice(nal, is_hevc)]
            note("frame", time.time(), self.number, n, is_key(slices[0], is_hevc), digest(slices))
            fates = ("lose", "damage", "swap")
            self.fate = next((fate for fate in fates if self.chance.random() < options.get(f"x_{fate}", 0)), None)
            # One of the packets behind the name.
            self.victim = at + 2 + self.chance.randrange(3)
            if n == options.get("x_cut"):
                self.fate, self.victim = "cut", at + 2
            return unit

        def end_frame(self):
            if self.frame:
                note("done", self.number, *self.frame)
            self.frame = None

        def packet(self, packet, rtcp=False):
            if rtcp:
                return super().packet(packet, rtcp)
            self.n_packets += 1
            fate = self.fate if self.n_packets == self.victim else None
            self.frame[1] = {"lose": "lost", "damage": "damaged"}.get(fate, self.frame[1].replace("omitted", "whole"))
            if fate == "damage":
                packet = bytearray(packet)
                for _ in range(self.chance.randint(1, 8)):
                    packet[self.chance.randrange(12, len(packet))] ^= self.chance.randint(1, 255)
            is_last = packet[1] >= 128
            if fate == "swap" and not is_last:
                self.held = packet
            if fate == "lose" or self.held is packet:
                return None
            try:
                if fate == "cut":
                    self.is_ended_here, self.frame[1] = True, "cut"
                    # To connect to nobody resets a connection, also while another thread reads from it.
                    ctypes.CDLL(None).connect(self.s.fileno(), bytes(16), 16)
                super().packet(bytes(packet))
                held, self.held = self.held, None
                return held and super().packet(held)
            except OSError:
                self.frame[1] = "cut"
                raise

    find_units = server.access_units
    server.access_units = lambda nals, hevc: Endless(find_units(nals, hevc))
    server.log, server.Client = log, Watched
    server.main()


if __name__ == "__main__":
    serve(*sys.argv[1:])
