"""Cameras of `costs.py`: an RTSP server that sends clips of H.264, and an HTTP server that writes pictures when it is told to.

Neither fails in any way; servers that do are those of `hour.py` and of the suite.
"""
import base64
import multiprocessing
import os
import random
import signal
import socket
import struct
import threading
import time

RATE_HZ, RTP_HZ, PAYLOAD_TYPE = 10, 90_000, 96
# Bytes of a NAL unit in one packet.
MOST_BYTES = 1400
SLICE, KEY_SLICE, SPS, PPS, FRAGMENT = 1, 5, 7, 8, 28


class Clip:
    """A clip of bare H.264 with one slice a picture, cut into packets."""

    def __init__(self, path):
        nals = [nal.rstrip(b"\0") for nal in path.read_bytes().split(b"\0\0\1")[1:]]
        sets = [next(nal for nal in nals if nal[0] & 31 == kind) for kind in (SPS, PPS)]
        self.profile = sets[0][1:4].hex()
        self.sets = ",".join(base64.b64encode(nal).decode() for nal in sets)
        self.pictures, packets = [], []
        for nal in nals:
            packets += split(nal)
            if nal[0] & 31 in (SLICE, KEY_SLICE):
                self.pictures.append(packets)
                packets = []

    def description(self):
        return (f"v=0\r\no=- 1 1 IN IP4 127.0.0.1\r\ns=clip\r\nc=IN IP4 0.0.0.0\r\nt=0 0\r\na=control:*\r\nm=video 0 RTP/AVP {PAYLOAD_TYPE}\r\n"
                f"a=rtpmap:{PAYLOAD_TYPE} H264/{RTP_HZ}\r\na=fmtp:{PAYLOAD_TYPE} packetization-mode=1;profile-level-id={self.profile};"
                f"sprop-parameter-sets={self.sets}\r\na=control:trackID=1\r\n").encode()


def split(nal):
    """Payloads of a NAL unit (RFC 6184): itself, or fragments of it."""
    if len(nal) <= MOST_BYTES:
        return [nal]
    parts = [nal[at:at + MOST_BYTES] for at in range(1, len(nal), MOST_BYTES)]
    marks = [0x80] + [0] * (len(parts) - 2) + [0x40]
    return [bytes([nal[0] & 0xE0 | FRAGMENT, nal[0] & 31 | mark]) + part for mark, part in zip(marks, parts)]


class Viewer(threading.Thread):
    """A connection of the RTSP server; the path asked for is `/CLIP/NUMBER`, and the number spreads cameras over a frame's time."""

    def __init__(self, connection, clips):
        super().__init__(daemon=True)
        self.connection, self.clips = connection, clips
        self.lock, self.is_playing = threading.Lock(), False

    def run(self):
        reader = self.connection.makefile("rb")
        try:
            while first := reader.read(1):
                if first == b"$":
                    reader.read(struct.unpack(">xH", reader.read(3))[0])  # Reports of the receiver.
                    continue
                lines = [(first + reader.readline()).decode().strip()]
                while line := reader.readline().decode().strip():
                    lines.append(line)
                self.answer(lines)
        except (OSError, struct.error):
            pass
        self.connection.close()

    def answer(self, lines):
        method, url, _ = lines[0].split(" ", 2)
        fields = {name.strip().lower(): value.strip() for name, value in (line.split(":", 1) for line in lines[1:])}
        clip, number = url.split("/")[3:5] if url.count("/") >= 4 else (None, "0")
        body, more = b"", ["Session: 1"]
        if method == "OPTIONS":
            more = ["Public: OPTIONS, DESCRIBE, SETUP, PLAY, GET_PARAMETER, TEARDOWN"]
        elif method == "DESCRIBE":
            body, more = self.clips[clip].description(), ["Content-Type: application/sdp", f"Content-Base: {url}/"]
        elif method == "SETUP":
            more.append("Transport: RTP/AVP/TCP;unicast;interleaved=0-1")
        text = "\r\n".join(["RTSP/1.0 200 OK", f"CSeq: {fields.get('cseq', 0)}", *more, f"Content-Length: {len(body)}"])
        with self.lock:
            self.connection.sendall(text.encode() + b"\r\n\r\n" + body)
        if method == "PLAY" and not self.is_playing:
            self.is_playing = True
            threading.Thread(target=self.play, args=(self.clips[clip].pictures, int(number)), daemon=True).start()

    def play(self, pictures, number):
        ssrc, sequence, first = random.getrandbits(32), random.getrandbits(15), random.getrandbits(31)
        began, n = time.monotonic() + number % 16 / 16 / RATE_HZ, 0
        try:
            while True:
                time.sleep(max(0.0, began + n / RATE_HZ - time.monotonic()))
                payloads, sent = pictures[n % len(pictures)], bytearray()
                for payload in payloads:
                    last = 0x80 if payload is payloads[-1] else 0
                    sent += struct.pack(">cBHBBHII", b"$", 0, 12 + len(payload), 0x80, last | PAYLOAD_TYPE, sequence & 0xFFFF,
                                        first + n * RTP_HZ // RATE_HZ & 0xFFFFFFFF, ssrc) + payload
                    sequence += 1
                with self.lock:
                    self.connection.sendall(sent)
                n += 1
        except OSError:
            pass  # The viewer has gone.


def listen():
    """A listening socket at a free port of this machine, for itself alone."""
    listener = socket.create_server(("127.0.0.1", 0), backlog=64)
    return listener, listener.getsockname()[1]


class RtspServer:
    """An RTSP server in a process of its own, for any number of cameras."""

    def __init__(self, paths):
        listener, self.port = listen()
        self.process = multiprocessing.get_context("fork").Process(target=serve, args=(listener, paths, os.getpid()), daemon=True)
        self.process.start()
        listener.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()

    def stop(self):
        self.process.kill()
        self.process.join()


def serve(listener, paths, parent):
    """Serves clips, by their paths' stems, until the process that began this has ended."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    clips = {path.stem: Clip(path) for path in paths}
    listener.settimeout(1.0)
    while os.getppid() == parent:
        try:
            connection, _ = listener.accept()
        except TimeoutError:
            continue
        connection.settimeout(None)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        Viewer(connection, clips).start()


class PictureServer:
    """An HTTP camera of JPEG pictures (`multipart/x-mixed-replace`), each of which is written when it is told to."""

    HEAD = b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=frame\r\nCache-Control: no-cache\r\n\r\n"

    def __init__(self):
        self.listener, self.port = listen()
        self.connection = None
        threading.Thread(target=self.accept, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.listener.close()
        if self.connection:
            self.connection.close()

    def accept(self):
        try:
            while True:
                connection, _ = self.listener.accept()
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                # A whole picture has room, so that to write it waits for nobody.
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 21)
                asked = b""
                while b"\r\n\r\n" not in asked and (piece := connection.recv(4096)):
                    asked += piece
                connection.sendall(self.HEAD)
                self.connection = connection
        except OSError:
            pass  # The server has ended.

    def write(self, picture):
        """Writes a picture, and returns when its last byte was written (`time.monotonic`), or None where nobody takes it."""
        if self.connection is None:
            return None
        head = b"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(picture)
        try:
            self.connection.sendall(head + picture)
            written = time.monotonic()
            self.connection.sendall(b"\r\n")
            return written
        except OSError:
            self.connection = None
            return None
