#!/usr/bin/env python3
"""Sends the daemon bombs of every kind: small inputs that announce enormous pictures, or that expand enormously.

    tests/cameras/bombs.py [--daemon FILE] [--seconds N] [--only NAME]

Every bomb is made here byte by byte and comes by RTSP, by HTTP or as a file (also as numbered pictures). A daemon in a folder of its
own has two ordinary cameras of 10 Hz: numbered pictures, which are read in the daemon itself, and JPEG over HTTP, which a process
of its own decodes. Bombs are added as cameras by the API, first one after the other, each taken away again, then all at once;
files are looked at before (`POST /api/v1/sources/look`). Of each it is told:

- RSS of the daemon alone before, and by how much it rose at most, sampled every 50 ms; RSS of all decoding processes together at most
  (pages that several of them share count for each);
- state and reason of the bomb's camera, and after how many seconds they were right;
- the rate of the slower of the ordinary cameras meanwhile.

Prints a table and a line at the end. Ends with 1 where a bomb moves the daemon's RSS by 50 MiB or more, an ordinary camera falls
below 80 % of its rate, or a bomb's reason does not say within 10 s what is wrong with it. JPEG over RTSP, whose pictures have room
for 2040 pixels a side, is shown, and may cost what a sound camera of that size costs as well. Needs Python 3.11 and nothing else.
"""
import argparse
import base64
import dataclasses
import json
import os
import pathlib
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import zlib

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "attacks"))
from harness.callers import Caller  # noqa: E402
from harness.house import end_with_parent, status_mib  # noqa: E402

MOST_MIB, LEAST_SHARE, REASON_SECS, SAMPLE_SECS = 50.0, 0.8, 10.0, 0.05
# Time for a look at the cameras: one that gives no frame is told so when it gave none for just these ten seconds.
LOOK_SECS = 1.0
RATE_HZ = 10.0
# Bytes a second of what never ends: more than any camera sends, and less than a processor's whole time.
FLOOD_BYTES = 8 << 20
MIB = 1 << 20
ORDINARY = ("pictures", "http")
NOT_SUPPORTED = "is not supported"

CONFIG = """\
[storage]
database = "bombs.sqlite"
[media]
roots = ["{folder}/media"]
[accuracy]
measure_at_start = false
[timeline]
mib_per_camera = 16
[render]
warm_up = false
[[camera]]
id = "pictures"
source = {{ path = "{folder}/media/ordinary/in%03d.png", rate_hz = 10.0, end = "loop" }}
[[camera]]
id = "http"
source = {{ url = "http://127.0.0.1:{port}/ordinary" }}
"""


# Pictures and streams ------------------------------------------------------------------------------------------------------------
class Bits:
    """Bits of a header, the highest of each byte first."""

    def __init__(self):
        self.text = ""

    def put(self, *pairs):
        """Adds numbers, each with its number of bits before it."""
        for n_bits, value in pairs:
            self.text += format(value, f"0{n_bits}b") if n_bits else ""
        return self

    def golomb(self, *values):
        """Adds numbers as ITU-T H.264, 9.1, writes them."""
        for value in values:
            length = (value + 1).bit_length()
            self.put((length - 1, 0), (length, value + 1))
        return self

    def signed(self, value):
        return self.golomb(2 * value - 1 if value > 0 else -2 * value)

    def bytes(self, closing="1"):
        """Returns the bytes, closed by a one and zeros."""
        text = self.text + closing
        text += "0" * (-len(text) % 8)
        return bytes(int(text[at:at + 8], 2) for at in range(0, len(text), 8))


def escaped(unit):
    """Keeps start codes from appearing in a unit."""
    return re.sub(rb"\0\0(?=[\0-\3])", b"\0\0\3", unit)


def chunk(kind, data):
    """Makes a part of a PNG file."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width, height, body=None, more=b""):
    """Makes a PNG in grey; by default its body is that of a small one."""
    body = zlib.compress(b"\0" * 65) if body is None else body
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + more + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def zeros(n_bytes, end=b""):
    """Compresses so many zeros, and an end, without ever holding them."""
    packer, pieces = zlib.compressobj(9), []
    for _ in range(n_bytes // MIB):
        pieces.append(packer.compress(bytes(MIB)))
    return b"".join([*pieces, packer.compress(end), packer.flush()])


def segment(marker, data):
    return bytes([0xff, marker]) + struct.pack(">H", len(data) + 2) + data


JPEG_TABLES = (segment(0xdb, bytes([0]) + bytes([16] * 64)) + segment(0xc4, bytes([0, 0, 0, 0, 12, *[0] * 12, *range(12)]))
               + segment(0xc4, bytes([0x10, 1, *[0] * 15, 0])))


def jpeg_head(width, height):
    """Makes a JPEG in grey up to its coded data."""
    frame = struct.pack(">BHHBBBB", 8, height, width, 1, 1, 0x11, 0)
    return b"\xff\xd8" + JPEG_TABLES + segment(0xc0, frame) + segment(0xda, bytes([1, 1, 0, 0, 63, 0]))


def jpeg(width, height, levels=None):
    """Makes a JPEG whose blocks have one brightness each: those of `levels`, or of a small picture."""
    bits, before = "", 0
    for level in levels or [128] * 16:
        value = (level - 128) // 2
        step, before = value - before, value
        size = abs(step).bit_length()
        bits += format(size, "04b")
        if size:
            bits += format(step if step > 0 else step + (1 << size) - 1, f"0{size}b")
        bits += "0"
    bits += "1" * (-len(bits) % 8)
    data = int(bits, 2).to_bytes(len(bits) // 8, "big").replace(b"\xff", b"\xff\0")
    return jpeg_head(width, height) + data + b"\xff\xd9"


def ordinary_pictures():
    """Makes pictures of 160 x 120 in which something moves."""
    for at in range(20):
        levels = [(30 + 9 * column + 5 * row + (90 if (column - at) % 20 < 4 else 0)) % 256 for row in range(15) for column in range(20)]
        yield levels


def bmp(width, height, bits=24, compression=0, body=bytes(96)):
    header = struct.pack("<IiiHHIIiiII", 40, width, height, 1, bits, compression, 0, 2835, 2835, 0, 0)
    palette = bytes(1024) if bits == 8 else b""
    return b"BM" + struct.pack("<IHHI", 54 + len(palette) + len(body), 0, 0, 54 + len(palette)) + header + palette + body


def j2k(side=40000, n_bytes=302):
    """Makes a code stream of JPEG 2000 of so many bytes."""
    size = struct.pack(">HIIIIIIIIH", 0, side, side, 0, 0, side, side, 0, 0, 3) + bytes([7, 1, 1] * 3)
    begin = b"\xff\x4f" + segment(0x51, size) + segment(0x52, bytes([0, 0, 0, 1, 1, 5, 4, 4, 0, 1]))
    begin += segment(0x5c, bytes([0x40, *[0x40] * 16])) + segment(0x90, struct.pack(">HIBB", 0, 0, 0, 1)) + b"\xff\x93"
    return begin + bytes(n_bytes - len(begin) - 2) + b"\xff\xd9"


def box(kind, *parts):
    """Makes a box of MP4, JPEG 2000 and the like."""
    data = b"".join(parts)
    return struct.pack(">I", len(data) + 8) + kind + data


def jp2(side=40000):
    image = box(b"ihdr", struct.pack(">IIHBBBB", side, side, 3, 7, 7, 0, 0))
    begin = box(b"jP  ", b"\r\n\x87\n") + box(b"ftyp", b"jp2 \0\0\0\0jp2 ")
    begin += box(b"jp2h", image, box(b"colr", struct.pack(">BBBI", 1, 0, 0, 16)))
    return begin + box(b"jp2c", j2k(side, 302 - len(begin) - 8))


SVG = (b'<?xml version="1.0"?><svg xmlns="http://www.w3.org/2000/svg" width="60000" height="60000"><filter id="f"><feGaussianBlur '
       b'stdDeviation="9999"/></filter><rect width="60000" height="60000" filter="url(#f)"/></svg>')


def laughs(root=b"svg", more=b' xmlns="http://www.w3.org/2000/svg" width="64" height="64"'):
    """Makes XML of a few hundred bytes whose text has ten thousand million letters."""
    entities = b"".join(b'<!ENTITY e%d "%s">' % (n, b"&e%d;" % (n - 1) * 10) for n in range(1, 10))
    return (b'<?xml version="1.0"?><!DOCTYPE %s [<!ENTITY e0 "0123456789">%s]><%s%s><text>&e9;</text></%s>'
            % (root, entities, root, more, root))


def webp(side=16384):
    """Makes a WebP without loss; 14 bits are all that a side has."""
    pixels = struct.pack("<BI", 0x2f, (side - 1) | (side - 1) << 14) + bytes(32)
    data = b"WEBPVP8L" + struct.pack("<I", len(pixels)) + pixels + b"\0" * (len(pixels) % 2)
    return b"RIFF" + struct.pack("<I", len(data)) + data


def gif(side=65535):
    return (b"GIF89a" + struct.pack("<HHBBB", side, side, 0x80, 0, 0) + bytes([0, 0, 0, 255, 255, 255])
            + b"," + struct.pack("<HHHHB", 0, 0, side, side, 0) + bytes([2, 3, 0x84, 0x51, 0, 0, 0x3b]))


def tiff(side=65535):
    tags = [(256, 4, side), (257, 4, side), (258, 3, 8), (259, 3, 32773), (262, 3, 1), (273, 4, 200), (278, 4, side), (279, 4, 16)]
    entries = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
    return (b"II*\0" + struct.pack("<IH", 8, len(tags)) + entries + bytes(4)).ljust(200, b"\0") + b"\x81\0" * 8


def h264(side=16384):
    """Makes the parameter sets and a picture's beginning: units without start codes."""
    sequence = Bits().put((24, 0x42003e)).golomb(0, 0, 2, 1).put((1, 0)).golomb(side // 16 - 1, side // 16 - 1).put((4, 0b1100))
    picture = Bits().golomb(0, 0).put((2, 0)).golomb(0, 0, 0).put((3, 0)).golomb(0, 0, 0).put((3, 0))
    slice_ = Bits().golomb(0, 7, 0).put((4, 0)).golomb(0).put((32, 0x8123456f))
    return [escaped(b"\x67" + sequence.bytes()), escaped(b"\x68" + picture.bytes()), escaped(b"\x65" + slice_.bytes() + b"\x5a" * 200)]


def h265(side=16384):
    layers = Bits().put((8, 1), (32, 0x60000000), (48, 0x900000000000), (8, 186)).text
    video = Bits().put((4, 0), (2, 3), (6, 0), (3, 0), (1, 1), (16, 0xffff))
    video.text += layers
    video.put((1, 1)).golomb(4, 0, 0).put((6, 0)).golomb(0).put((2, 0))
    sequence = Bits().put((4, 0), (3, 0), (1, 1))
    sequence.text += layers
    sequence.golomb(0, 1, side, side).put((1, 0)).golomb(0, 0, 4).put((1, 1)).golomb(4, 0, 0, 0, 3, 0, 3, 0, 0)
    sequence.put((4, 0)).golomb(0).put((5, 0))
    picture = Bits().golomb(0, 0).put((7, 0)).golomb(0, 0, 0).put((3, 0)).golomb(0, 0).put((11, 0)).golomb(0).put((2, 0))
    return [escaped(bytes([kind << 1, 1]) + bits.bytes()) for kind, bits in ((32, video), (33, sequence), (34, picture))] + [
        escaped(bytes([19 << 1, 1, 0xac]) + b"\x5a" * 200)]


def with_start_codes(units, n_times=30):
    return b"".join(b"\0\0\0\1" + unit for unit in [*units[:-1], *units[-1:] * n_times])


def vp8(side=16383):
    return bytes([0x10, 2, 0, 0x9d, 1, 0x2a]) + struct.pack("<HH", side, side) + b"\x5a" * 64


def vp9(side=65536):
    head = Bits().put((2, 2), (2, 0), (1, 0), (1, 0), (1, 1), (1, 0), (24, 0x498342), (3, 1), (1, 0), (16, side - 1), (16, side - 1))
    return head.put((1, 0)).bytes() + b"\x5a" * 64


def av1(side=65536):
    """Makes a sequence header of AV1, without its length."""
    head = Bits().put((3, 0), (1, 0), (1, 0), (1, 0), (1, 0), (5, 0), (12, 0), (5, 8), (1, 0), (4, 15), (4, 15), (16, side - 1))
    head.put((16, side - 1), (1, 0), (1, 0), (1, 0), (1, 0), (5, 0), (1, 1), (1, 1), (3, 0), (1, 0), (1, 0), (1, 0), (1, 0), (2, 0), (2, 0))
    return head.bytes()


def av1_unit(side=65536):
    frame = b"\x10" + b"\x5a" * 40
    return b"\x12\0\x0a" + bytes([len(av1(side))]) + av1(side) + b"\x32" + bytes([len(frame)]) + frame


def mpeg4(side=8191):
    layer = Bits().put((1, 0), (8, 1), (1, 0), (4, 1), (1, 0), (2, 0), (1, 1), (16, 10), (1, 1), (1, 0), (1, 1), (13, side), (1, 1))
    layer.put((13, side), (1, 1), (1, 0), (1, 1), (1, 0), (1, 0), (1, 0), (1, 1), (1, 1), (1, 0), (1, 0))
    head = b"\0\0\1\xb0\xf5\0\0\1\xb5\x09\0\0\1\0\0\0\1\x20" + layer.bytes("0" + "1" * 7)
    return head, b"\0\0\1\xb6\x10\x60" + b"\x5a" * 64


# Containers ----------------------------------------------------------------------------------------------------------------------
def ivf(codec, frame, n_frames=20):
    head = b"DKIF" + struct.pack("<HH4sHHIIII", 0, 32, codec, 320, 240, 10, 1, n_frames, 0)
    return head + b"".join(struct.pack("<IQ", len(frame), at) + frame for at in range(n_frames))


def ebml(id_, *parts, announced=None):
    """Makes an element of Matroska, which may announce another length than it has."""
    data = b"".join(part if isinstance(part, bytes) else part.to_bytes(max(1, (part.bit_length() + 7) // 8), "big") for part in parts)
    length = len(data) if announced is None else announced
    return bytes.fromhex(id_) + (1 << 56 | length).to_bytes(8, "big") + data


def matroska(codec, frame, more_track=b"", before=b"", width=320, height=240, n_frames=20, cluster=None):
    head = ebml("1a45dfa3", ebml("4282", b"matroska"), ebml("4287", 2), ebml("4285", 2))
    video = ebml("e0", ebml("b0", width), ebml("ba", height))
    track = ebml("ae", ebml("d7", 1), ebml("73c5", 1), ebml("83", 1), ebml("86", codec), video, more_track)
    blocks = b"".join(ebml("a3", b"\x81" + struct.pack(">H", 100 * at) + b"\x80" + frame) for at in range(n_frames))
    body = ebml("1549a966", ebml("2ad7b1", 1000000)) + before + ebml("1654ae6b", track)
    return head + ebml("18538067", body, ebml("1f43b675", ebml("e7", 0), blocks) if cluster is None else cluster)


ZIPPED = ebml("6d80", ebml("6240", ebml("5031", 0), ebml("5032", 1), ebml("5033", 0), ebml("5034", ebml("4254", 0))))


def nested(n_levels, id_="67c8"):
    """Makes elements of Matroska within each other, so many of them."""
    heads, length = [], 0
    for _ in range(n_levels):
        heads.append(bytes.fromhex(id_) + (1 << 56 | length).to_bytes(8, "big"))
        length += len(heads[-1])
    return b"".join(reversed(heads))


def nested_boxes(kind, n_levels):
    return b"".join(struct.pack(">I", 8 * (n_levels - at)) + kind for at in range(n_levels))


def mp4_track(width, height, entry, sizes, n_samples, at, length):
    full = bytes(4)
    matrix = struct.pack(">9I", 65536, 0, 0, 0, 65536, 0, 0, 0, 1 << 30)
    head = box(b"tkhd", struct.pack(">IIIII", 7, 0, 0, 1, 0), struct.pack(">I", 2000), bytes(16), matrix,
               struct.pack(">II", min(width, 65535) << 16, min(height, 65535) << 16))
    table = box(b"stbl", box(b"stsd", full, struct.pack(">I", 1), entry), box(b"stts", full, struct.pack(">III", 1, n_samples, 100)),
                box(b"stsc", full, struct.pack(">IIII", 1, 1, n_samples, 1)), box(b"stsz", full, sizes),
                box(b"stco", full, struct.pack(">II", 1, at)))
    data = box(b"dinf", box(b"dref", full, struct.pack(">I", 1), box(b"url ", struct.pack(">I", 1))))
    media = box(b"mdia", box(b"mdhd", full, struct.pack(">IIIII", 0, 0, 1000, length, 0x55c40000)),
                box(b"hdlr", full, bytes(4), b"vide", bytes(13)), box(b"minf", box(b"vmhd", struct.pack(">IQ", 1, 0)), data, table))
    return box(b"moov", box(b"mvhd", full, struct.pack(">IIIIIH", 0, 0, 1000, length, 65536, 256), bytes(10), matrix, bytes(24),
                            struct.pack(">I", 2)), box(b"trak", head, media))


def mp4(kind, header, frames, width=320, height=240, n_announced=None, size_announced=None):
    """Makes an MP4 file whose tables may announce more samples, and larger ones, than there are."""
    begin, n_samples = box(b"ftyp", b"isom\0\0\2\0isommp41"), n_announced or len(frames)
    entry = box(kind, bytes(6), struct.pack(">H", 1), bytes(16), struct.pack(">HHIIIH", width, height, 72 << 16, 72 << 16, 0, 1),
                bytes(32), struct.pack(">Hh", 24, -1), header)
    sizes = struct.pack(">II", size_announced, n_samples) if size_announced else (
        struct.pack(">II", 0, n_samples) + b"".join(struct.pack(">I", len(frame)) for frame in frames))
    return begin + box(b"mdat", *frames) + mp4_track(width, height, entry, sizes, n_samples, len(begin) + 8, 2000)


def avcc(units):
    sets = [struct.pack(">H", len(unit)) + unit for unit in units[:2]]
    return box(b"avcC", bytes([1, *units[0][1:4], 0xff, 0xe1]), sets[0], b"\1", sets[1])


def mp4_zipped(n_bytes):
    """Makes a film whose header is compressed, and announces and expands to so many bytes."""
    packed = box(b"cmvd", struct.pack(">I", n_bytes), zeros(n_bytes))
    return box(b"ftyp", b"qt  \0\0\2\0qt  ") + box(b"moov", box(b"cmov", box(b"dcom", b"zlib"), packed)) + box(b"mdat", bytes(64))


def riff(kind, *parts):
    data = b"".join(parts)
    return kind + struct.pack("<I", len(data)) + data + b"\0" * (len(data) % 2)


def avi(codec, frame, width=320, height=240, bits=24, announced=None, n_frames=20):
    main = struct.pack("<14I", 100000, 0, 0, 0x10, n_frames, 0, 1, 0, width, height, 0, 0, 0, 0)
    stream = b"vids" + (codec or bytes(4)) + struct.pack("<IHHIIIIIIIIhhhh", 0, 0, 0, 0, 1, 10, 0, n_frames, 0, 0, 0, 0, 0, 0, 0)
    format_ = struct.pack("<IiiHH4sIiiII", 40, width, height, 1, bits, codec or bytes(4), 0, 0, 0, 0, 0)
    head = riff(b"LIST", b"hdrl", riff(b"avih", main), riff(b"LIST", b"strl", riff(b"strh", stream), riff(b"strf", format_)))
    if announced:
        film = b"LIST" + struct.pack("<I", announced) + b"movi00dc" + struct.pack("<I", announced - 12) + frame
        return b"RIFF" + struct.pack("<I", announced) + b"AVI " + head + film
    return riff(b"RIFF", b"AVI ", head, riff(b"LIST", b"movi", *[riff(b"00dc", frame)] * n_frames))


def flv(units):
    def tag(data, at):
        return b"\x09" + struct.pack(">I", len(data))[1:] + struct.pack(">I", at)[1:] + bytes(4) + data + struct.pack(">I", len(data) + 11)
    picture = struct.pack(">I", len(units[2])) + units[2]
    return b"FLV\1\1\0\0\0\x09" + bytes(4) + tag(b"\x17\0\0\0\0" + avcc(units)[8:], 0) + b"".join(
        tag(b"\x17\1\0\0\0" + picture, 100 * at) for at in range(20))


def transport_stream(data):
    """Makes an MPEG transport stream of H.264."""
    def checked(section):
        crc = 0xffffffff
        for byte in section:
            crc ^= byte << 24
            for _ in range(8):
                crc = crc << 1 & 0xffffffff ^ (0x04c11db7 if crc >> 31 else 0)
        return section + struct.pack(">I", crc)

    def packet(pid, number, piece, is_first):
        n_stuffing = 184 - len(piece)
        stuffing = b"" if n_stuffing == 0 else bytes([n_stuffing - 1]) + (b"\0" + b"\xff" * (n_stuffing - 2) if n_stuffing > 1 else b"")
        return struct.pack(">BHB", 0x47, pid | is_first << 14, (0x30 if stuffing else 0x10) | number & 15) + stuffing + piece
    programs = b"\0" + checked(bytes.fromhex("00b00d0001c100000001f000"))
    streams = b"\0" + checked(bytes.fromhex("02b0120001c10000e100f0001be100f000"))
    tables = [packet(0, 0, programs.ljust(184, b"\xff"), 1), packet(0x1000, 0, streams.ljust(184, b"\xff"), 1)]
    made, number = [], 0
    for at in range(20):
        time_ = 90000 + 9000 * at
        stamp = bytes([0x21 | time_ >> 29 & 14, time_ >> 22 & 255, time_ >> 14 & 254 | 1, time_ >> 7 & 255, time_ << 1 & 254 | 1])
        unit = b"\0\0\1\xe0\0\0\x80\x80\5" + stamp + b"\0\0\0\1\x09\xf0" + data
        made += [bytes(part) for part in tables]
        for begin in range(0, len(unit), 184):
            made.append(packet(0x100, number, unit[begin:begin + 184], begin == 0))
            number += 1
    return b"".join(made)


# What is sent over the wire ------------------------------------------------------------------------------------------------------
def described(number, name, more=""):
    """Makes the description of a stream."""
    return f"m=video 0 RTP/AVP {number}\r\na=rtpmap:{number} {name}/90000\r\n" + (f"a=fmtp:{number} {more}\r\n" if more else "")


def text64(data):
    return base64.b64encode(data).decode()


class Flood:
    """Sends pieces for ever, so many bytes a second."""

    def __init__(self, begin, piece, rate=FLOOD_BYTES):
        self.begin, self.piece, self.rate = begin, piece, rate

    def __call__(self, stream, *_):
        stream.sendall(self.begin)
        began, n_bytes = time.monotonic(), 0
        while True:
            stream.sendall(self.piece)
            n_bytes += len(self.piece)
            time.sleep(max(0.0, began + n_bytes / self.rate - time.monotonic()))


def answer(kind, body, more="", length=None):
    """Answers a request over HTTP with one body, of which more may be announced than comes; the connection then stays as it is."""
    head = f"HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\nContent-Length: {length or len(body)}\r\n{more}\r\n".encode()

    def send(stream):
        stream.sendall(head + body)
        if length:
            time.sleep(60)
    return send


def parts(pictures, kind="image/jpeg", length=None):
    """Answers with one picture after the other, ten a second."""
    def send(stream):
        stream.sendall(b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=b\r\n\r\n")
        at, began = 0, time.monotonic()
        while True:
            picture = pictures[at % len(pictures)]
            stream.sendall(f"--b\r\nContent-Type: {kind}\r\nContent-Length: {length or len(picture)}\r\n\r\n".encode() + picture + b"\r\n")
            at += 1
            time.sleep(max(0.0, began + at / RATE_HZ - time.monotonic()))
    return send


class Server:
    """Listens on a port of its own; what is asked for by path behaves as it is told."""

    def __init__(self, serve):
        self.listener = socket.create_server(("127.0.0.1", 0), backlog=128)
        self.port, self.serve, self.ways = self.listener.getsockname()[1], serve, {}
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            stream, _ = self.listener.accept()
            threading.Thread(target=self.run, args=(stream,), daemon=True).start()

    def run(self, stream):
        try:
            with stream:
                stream.settimeout(60)
                stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self.serve(stream, self.ways)
        except (OSError, ValueError, IndexError):
            pass  # The daemon hung up.


def head_of(stream, rest=b""):
    """Reads a request's head, past packets between requests; the head and what follows it."""
    while True:
        while rest[:1] == b"$" and len(rest) >= 4 and len(rest) >= 4 + int.from_bytes(rest[2:4], "big"):
            rest = rest[4 + int.from_bytes(rest[2:4], "big"):]
        if rest[:1] != b"$" and b"\r\n\r\n" in rest:
            head, rest = rest.split(b"\r\n\r\n", 1)
            return head.decode("latin-1"), rest
        piece = stream.recv(65536)
        if not piece:
            raise OSError("closed")
        rest += piece


def serve_http(stream, ways):
    head, _ = head_of(stream)
    way = ways.get(head.split(" ")[1].strip("/"))
    if way is None:
        stream.sendall(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n")
    else:
        way(stream)


def serve_rtsp(stream, ways):
    """Answers requests; a way is a description with payloads that are sent ten times a second, or sends by itself."""
    rest, lock = b"", threading.Lock()
    while True:
        head, rest = head_of(stream, rest)
        method, url = head.split(" ")[:2]
        sequence = re.search(r"(?i)^cseq: *(\d+)", head, re.M)
        way = ways[url.split("/")[3]]

        def reply(fields, body=b"", sequence=sequence):
            text = f"RTSP/1.0 200 OK\r\nCSeq: {sequence[1]}\r\n{fields}" + (f"Content-Length: {len(body)}\r\n" if body else "")
            with lock:
                stream.sendall(text.encode() + b"\r\n" + body)
        if method == "OPTIONS":
            reply("Public: OPTIONS, DESCRIBE, SETUP, PLAY, TEARDOWN, GET_PARAMETER\r\n")
        elif method == "DESCRIBE" and not isinstance(way, tuple):
            way(stream, sequence[1])
        elif method == "DESCRIBE":
            text = f"v=0\r\no=- 1 1 IN IP4 0.0.0.0\r\ns=b\r\nc=IN IP4 0.0.0.0\r\nt=0 0\r\n{way[0]}a=control:trackID=1\r\n"
            reply(f"Content-Type: application/sdp\r\nContent-Base: {url}/\r\n", text.encode())
        elif method == "SETUP":
            reply("Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\nSession: 1\r\n")
        elif method == "PLAY":
            reply("Session: 1\r\nRange: npt=0.000-\r\n")
            threading.Thread(target=send_packets, args=(stream, lock, *way), daemon=True).start()
        else:
            reply("Session: 1\r\n")


def send_packets(stream, lock, description, payloads, endless=None):
    """Sends the payloads as a frame ten times a second; an endless one goes on for ever instead."""
    number, sequence, began = int(re.search(r"AVP (\d+)", description)[1]), 0, time.monotonic()

    def send(payload, at, is_last):
        nonlocal sequence
        packet = struct.pack(">BBHII", 0x80, number | is_last << 7, sequence & 65535, 9000 * at, 7) + payload
        with lock:
            stream.sendall(b"$\0" + struct.pack(">H", len(packet)) + packet)
        sequence += 1
    try:
        for at in range(1 << 30):
            for payload in payloads:
                send(payload, at, payload is payloads[-1] and endless is None)
            n_bytes = 0
            while endless is not None:
                send(endless, at, False)
                n_bytes += len(endless)
                time.sleep(max(0.0, began + n_bytes / FLOOD_BYTES - time.monotonic()))
            time.sleep(max(0.0, began + (at + 1) / RATE_HZ - time.monotonic()))
    except OSError:
        pass  # The daemon hung up.


# Bombs ---------------------------------------------------------------------------------------------------------------------------
@dataclasses.dataclass
class Bomb:
    """A bomb: a name, how it comes (`file`, `numbered`, `http`, `rtsp`), what it is, and what its state and reason must say."""

    name: str
    way: str
    content: object
    right: str
    # What a sound camera of such pictures costs is not a bomb's doing.
    is_large: bool = False

    def source(self, folder, ports):
        """Puts it where it is found; the source that the daemon is given."""
        if self.way in ports:
            return {"url": f"{self.way}://127.0.0.1:{ports[self.way]}/{self.name}"} | ({"transport": "tcp"} if self.way == "rtsp" else {})
        ending = self.content[0]
        stem = folder / (f"{self.name}-%03d" if self.way == "numbered" else self.name)
        for number in range(1, 4 if self.way == "numbered" else 2):
            path = pathlib.Path(str(stem).replace("%03d", f"{number:03}") + ending)
            path.write_bytes(self.content[1])
        return {"path": f"{stem}{ending}", "end": "loop"}

    @property
    def n_bytes(self):
        return len(self.content[1]) if self.way in ("file", "numbered") else None


# Files begin together: one that is ready may wait for others.
SHOWN = "^(live|ended)|it is ready and waits for the files"
# Numbered pictures are not told with their size, but with the one that is allowed.
TOO_LARGE = "8192 pixels a side and 36 megapixels.*size exceeds limit"


def of_size(width, height=None):
    return rf"\b{width} x {height or width}\b.*allowed are 8192 pixels a side and 36 megapixels"


def file_bombs():
    avc, layer = h264(), mpeg4()
    sound = jpeg(64, 64, [128] * 64)
    small, profile = zlib.compress(bytes(65 * 64)), b"icc\0\0" + zeros(256 * MIB)
    packed = zeros(512 * MIB)
    films = [
        ("j2k-file", ".jp2", jp2(), f"JPEG 2000.*{NOT_SUPPORTED}|JPEG 2000, which is not"),
        ("j2k-bare-file", ".j2k", j2k(), "JPEG 2000, which is not supported|no video that GStreamer knows"),
        ("svg-file", ".svg", SVG, "SVG, which is not supported"),
        ("svg-laughs-file", ".svg", laughs(), "SVG, which is not supported"),
        ("webp-file", ".webp", webp(), "WebP, which is not supported"),
        ("tiff-file", ".tiff", tiff(), "(?i)tiff.*, which is not supported"),
        ("gif-file", ".gif", gif(), "(?i)gif.*, which is not supported"),
        ("png-file", ".png", png(65500, 65500), of_size(65500)),
        ("png-zeros-file", ".png", png(65500, 65500, zeros(256 * MIB)), of_size(65500)),
        ("png-long-body-file", ".png", png(64, 64, zeros(256 * MIB)), SHOWN),
        ("png-profile-file", ".png", png(64, 64, small, chunk(b"iCCP", profile)), SHOWN),
        ("jpeg-file", ".jpg", jpeg(65500, 65500), of_size(65500)),
        ("bmp-file", ".bmp", bmp(60000, 60000), of_size(60000)),
        ("bmp-packed-file", ".bmp", bmp(60000, 60000, 8, 1, b"\xff\0" * 40 + b"\0\1"), of_size(60000)),
        ("h264-file", ".h264", with_start_codes(avc), of_size(16384)),
        ("h265-file", ".h265", with_start_codes(h265()), of_size(16384)),
        ("vp8-file", ".ivf", ivf(b"VP80", vp8()), of_size(16383)),
        ("vp9-file", ".ivf", ivf(b"VP90", vp9()), of_size(65536)),
        ("av1-file", ".ivf", ivf(b"AV01", av1_unit()), of_size(65536)),
        ("mpeg4-file", ".m4v", layer[0] + layer[1] * 20, of_size(8191)),
        ("y4m-file", ".y4m", b"YUV4MPEG2 W65520 H65520 F10:1 Ip A1:1 C420jpeg\nFRAME\n" + bytes(64), of_size(65520)),
        ("mkv-file", ".mkv", matroska(b"V_VP8", vp8()), of_size(16383)),
        ("mkv-raw-file", ".mkv", matroska(b"V_UNCOMPRESSED", bytes(64), ebml("e0", ebml("2eb524", b"I420")), width=60000, height=60000),
         of_size(60000)),
        ("mkv-nested-file", ".mkv", matroska(b"V_VP8", vp8(), before=ebml("1254c367", ebml("7373", nested(20000)))), of_size(16383)),
        ("mkv-zipped-file", ".mkv", matroska(b"V_MJPEG", packed, ZIPPED, n_frames=2), "ends before its first frame|gave no frame for 10 s"),
        ("mkv-private-file", ".mkv", matroska(b"V_VP8", vp8(), ebml("63a2", bytes(16), announced=1 << 40)),
         "breaks off|no video|ends before its first frame|too large"),
        ("mkv-block-file", ".mkv", matroska(b"V_VP8", b"", cluster=ebml("1f43b675", ebml("e7", 0), ebml("a3", bytes(16), announced=1 << 40))),
         "ends before its first frame|cannot be decoded"),
        ("mp4-file", ".mp4", mp4(b"avc1", avcc(avc), [struct.pack(">I", len(avc[2])) + avc[2]] * 20), of_size(16384)),
        ("mp4-jpeg-file", ".mp4", mp4(b"jpeg", b"", [jpeg(65500, 65500)] * 5, 65500, 65500), of_size(65500)),
        ("mp4-samples-file", ".mp4", mp4(b"jpeg", b"", [sound] * 5, n_announced=0xffffffff, size_announced=1),
         "no video|cannot be decoded|ends before its first frame|too large"),
        ("mp4-sample-file", ".mp4", mp4(b"jpeg", b"", [sound], n_announced=1, size_announced=0xfffffff0),
         "no video|cannot be decoded|ends before its first frame|too large"),
        ("mp4-nested-file", ".mp4", box(b"ftyp", b"isom\0\0\2\0isom") + nested_boxes(b"moov", 50000),
         "no video|its decoding process ended, since it crashed"),
        ("mp4-zipped-file", ".mov", mp4_zipped(256 * MIB), "no video|cannot be decoded"),
        ("avi-file", ".avi", avi(b"MJPG", jpeg(65500, 65500)), of_size(65500)),
        ("avi-raw-file", ".avi", avi(None, bytes(64), 32767, 32767), of_size(32767)),
        ("avi-chunk-file", ".avi", avi(b"MJPG", sound, announced=0x7ffffff0), "cannot be decoded|ends before its first frame|no video"),
        ("flv-file", ".flv", flv(avc), of_size(16384)),
        ("ts-file", ".ts", transport_stream(with_start_codes(avc, 1)), of_size(16384)),
        ("playlist-file", ".m3u8", b"#EXTM3U\n#EXT-X-TARGETDURATION:9\n" + b"#EXTINF:9,\na.ts\n" * 9, "(?i)hls|m3u|no video"),
        ("gzip-file", ".avi", b"\x1f\x8b\x08\0\0\0\0\0\0\3" + zeros(64 * MIB)[2:-4] + bytes(8), "(?i)gzip|no video"),
    ]
    numbered = [
        ("png-numbered", ".png", png(65500, 65500), TOO_LARGE),
        ("jpeg-numbered", ".jpg", jpeg(65500, 65500), TOO_LARGE),
        ("png-zeros-numbered", ".png", png(8000, 8000, zeros(64 * MIB)), TOO_LARGE),
        ("png-profile-numbered", ".png", png(64, 64, small, chunk(b"iCCP", profile)), SHOWN),
        ("gif-numbered", ".png", gif(), "(?i)gif.*not supported|cannot decode .*JPEG or PNG"),
    ]
    return [Bomb(name, way, (ending, data), right) for way, bombs in (("file", films), ("numbered", numbered))
            for name, ending, data, right in bombs]


def http_bombs():
    def sends(kind):
        return rf"it sends {kind}.*no JPEG picture"
    head = b"HTTP/1.1 200 OK\r\nContent-Type: "
    multipart = head + b"multipart/x-mixed-replace; boundary=b\r\n\r\n--b\r\n"
    bombs = [
        ("jpeg-parts", parts([jpeg(65500, 65500)]), of_size(65500)),
        ("jpeg-single", answer("image/jpeg", jpeg(65500, 65500)), of_size(65500)),
        ("j2k-single", answer("image/jp2", jp2()), sends("image/jp2")),
        ("j2k-parts", parts([j2k()], "image/jp2"), sends("multipart")),
        ("j2k-as-jpeg", parts([jp2()]), sends("multipart")),
        ("svg-single", answer("image/svg+xml", SVG), sends("image/svg")),
        ("webp-single", answer("image/webp", webp()), sends("image/webp")),
        ("gif-parts", parts([gif()], "image/gif"), sends("multipart")),
        ("html", answer("text/html", b"<html>" + b"<div>" * 50000), sends("text/html")),
        ("xml-laughs", answer("text/xml", laughs(b"a", b"")), sends("text/xml")),
        ("playlist", answer("application/vnd.apple.mpegurl", b"#EXTM3U\n#EXTINF:9,\nhttp://127.0.0.1/a.ts\n" * 99), sends("application/vnd")),
        ("gzip", answer("image/jpeg", zeros(256 * MIB), "Content-Encoding: deflate\r\n"), sends("image/jpeg")),
        ("length", answer("image/jpeg", jpeg_head(640, 480), length=8 << 30), "sent no frame|never end|no JPEG picture|picture.*end"),
        ("length-of-part", parts([jpeg(65500, 65500)], length=8 << 30), of_size(65500)),
        ("endless-picture", Flood(multipart + b"\r\n" + jpeg_head(640, 480), b"\x5a" * 65536),
         "no JPEG picture in|picture.*(end|too large|larger)"),
        ("endless-segments", Flood(multipart + b"\r\n\xff\xd8", segment(0xe1, bytes(65000))),
         "no JPEG picture in|picture.*(end|too large|larger)"),
        ("endless-part", Flood(multipart + b"Content-Type: image/jpeg\r\n\r\n", b"\x5a" * 65536), sends("multipart")),
        ("endless-head", Flood(b"HTTP/1.1 200 OK\r\n", b"X-Field: " + b"x" * 60000 + b"\r\n"), "does not answer as a camera"),
        ("endless-field", Flood(b"HTTP/1.1 200 OK\r\nX: ", b"x" * 65536), "does not answer as a camera"),
        ("chunk", lambda stream: (stream.sendall(head + b"image/jpeg\r\nTransfer-Encoding: chunked\r\n\r\nfffffffffffffff0\r\n"
                                                 + jpeg(65500, 65500)), time.sleep(60)), of_size(65500)),
    ]
    return [Bomb(f"{name}-http", "http", way, right) for name, way, right in bombs]


def rtsp_bombs():
    avc, hevc, layer = h264(), h265(), mpeg4()
    usual = h264(320)
    sets = ",".join(map(text64, avc[:2]))
    hevc_sets = ";".join(f"sprop-{name}={text64(unit)}" for name, unit in zip(("vps", "sps", "pps"), hevc))
    av1_payload = b"\x28" + bytes([len(av1()) + 1]) + b"\x08" + av1() + b"\x30\x10" + b"\x5a" * 40
    raw = "sampling=YCbCr-4:2:0; width={0}; height={0}; depth=8; colorimetry=BT601-5"
    line = struct.pack(">HHHH", 0, 60, 0, 0) + bytes(60)
    picture = struct.pack(">BBHBBBB", 0, 0, 0, 1, 50, 255, 255) + b"\x5a" * 300
    bombs = [
        ("j2k", (described(97, "jpeg2000"), [bytes(8) + j2k()]), "JPEG ?2000, which is not supported"),
        ("theora", (described(97, "theora", "sampling=YCbCr-4:2:0; width=1048560; height=1048560"), [bytes(64)]),
         "(?i)theora, which is not supported"),
        ("h264", (described(96, "H264", "packetization-mode=1"), avc), of_size(16384)),
        ("h264-described", (described(96, "H264", f"packetization-mode=1;sprop-parameter-sets={sets}"), avc[2:]), of_size(16384)),
        ("h265", (described(96, "H265"), hevc), of_size(16384)),
        ("h265-described", (described(96, "H265", hevc_sets), hevc[3:]), of_size(16384)),
        ("vp8", (described(96, "VP8"), [b"\x10" + vp8()]), of_size(16383)),
        ("vp9", (described(96, "VP9"), [b"\x0c" + vp9()]), of_size(65536)),
        ("av1", (described(96, "AV1"), [av1_payload]), of_size(65536) + "|needs a reader for AV1 over RTP, which is not installed"),
        ("mpeg4", (described(96, "MP4V-ES", f"profile-level-id=1;config={layer[0].hex()}"), [layer[0] + layer[1]]), of_size(8191)),
        ("raw", (described(96, "raw", raw.format(32766)), [line]), of_size(32766)),
        ("raw-largest", (described(96, "raw", raw.format(2147483646)), [line]), r"2147483646|not supported|pictures of|size"),
        ("jpeg", (described(26, "JPEG"), [picture]), "(cannot be decoded|sent no frame|JPEG)|^live"),
        ("endless-unit", (described(96, "H264", "packetization-mode=1"), [*usual[:2], b"\x7c\x85" + b"\x5a" * 1000], b"\x7c\x05" + b"\x5a" * 1300),
         "sent no frame|end|too large"),
        ("endless-jpeg", (described(26, "JPEG"), [picture], struct.pack(">BBHBBBB", 0, 1, 0, 1, 50, 40, 30) + b"\x5a" * 1300),
         "sent no frame|end|too large|cannot be decoded"),
        ("length", lambda stream, number: stream.sendall(
            f"RTSP/1.0 200 OK\r\nCSeq: {number}\r\nContent-Type: application/sdp\r\nContent-Length: 8589934592\r\n\r\nv=0\r\n".encode()),
         "does not answer as a camera"),
        ("endless-head", Flood(b"RTSP/1.0 200 OK\r\n", b"X-Field: " + b"x" * 60000 + b"\r\n"), "does not answer as a camera"),
        ("html", lambda stream, _number: stream.sendall(b"HTTP/1.1 200 OK\r\nContent-Type: text/html\r\n\r\n" + b"<div>" * 9999),
         "does not answer as a camera"),
        ("streams", (described(97, "jpeg2000") * 5000, [bytes(64)]), "JPEG ?2000, which is not supported"),
    ]
    return [Bomb(f"{name}-rtsp", "rtsp", way, right, name == "jpeg") for name, way, right in bombs]


# Daemon and measurements ---------------------------------------------------------------------------------------------------------
class Sampler(threading.Thread):
    """Takes the RSS of a process, and that of its children together, every 50 ms."""

    def __init__(self, process):
        super().__init__(daemon=True)
        self.process, self.now, self.most, self.most_workers, self.is_over = process, 0.0, 0.0, 0.0, threading.Event()

    def run(self):
        at = time.monotonic()
        while not self.is_over.is_set():
            self.now = status_mib(self.process, "VmRSS")
            self.most = max(self.most, self.now)
            self.most_workers = max(self.most_workers, self.workers())
            at = max(at + SAMPLE_SECS, time.monotonic())
            self.is_over.wait(at - time.monotonic())

    def workers(self):
        total = 0.0
        for children in pathlib.Path(f"/proc/{self.process}/task").glob("*/children"):
            try:
                total += sum(status_mib(int(child), "VmRSS") for child in children.read_text().split())
            except OSError:
                pass  # That thread has ended.
        return total

    def begin(self):
        """Begins anew; the RSS at that time."""
        self.most = self.most_workers = 0.0
        return self.now


class Run:
    """A daemon, what feeds it, and what was found."""

    def __init__(self, arguments, folder):
        self.folder, self.secs, self.rows, self.harms, self.large_mib = folder, arguments.seconds, [], [], 0.0
        (folder / "media" / "ordinary").mkdir(parents=True)
        levels = list(ordinary_pictures())
        for at, picture in enumerate(levels):
            rows = b"".join(b"\0" + bytes(level for level in picture[20 * row:20 * row + 20] for _ in range(8)) * 1 for row in range(15)
                            for _ in range(8))
            (folder / "media" / "ordinary" / f"in{at:03}.png").write_bytes(png(160, 120, zlib.compress(rows)))
        self.http, self.rtsp = Server(serve_http), Server(serve_rtsp)
        self.http.ways["ordinary"] = parts([jpeg(160, 120, picture) for picture in levels])
        self.ports = {"http": self.http.port, "rtsp": self.rtsp.port}
        config = folder / "bombs.toml"
        config.write_text(CONFIG.format(folder=folder, port=self.http.port))
        environment = {name: value for name, value in os.environ.items() if not name.startswith(("VIDEOFIELDS_", "RUST_LOG"))}
        self.log = open(folder / "daemon.log", "w+", encoding="utf-8", errors="replace")
        self.daemon = subprocess.Popen([os.path.abspath(arguments.daemon), "serve", "--config", str(config), "--listen", "127.0.0.1:0"],
                                       stdout=subprocess.PIPE, stderr=self.log, env=environment, preexec_fn=end_with_parent)
        found = re.search(r":(\d+)/", self.daemon.stdout.readline().decode())
        if not found:
            raise RuntimeError(f"the daemon does not start: {self.logged()[-2000:]}")
        self.caller = Caller(int(found[1]))
        self.sampler = Sampler(self.daemon.pid)
        self.sampler.start()

    def logged(self):
        self.log.flush()
        return (self.folder / "daemon.log").read_text(encoding="utf-8", errors="replace")

    def cameras(self):
        """The time, and the cameras by their ids."""
        answered = self.caller.get("/api/v1/cameras")
        if answered.status != 200 or self.daemon.poll() is not None:
            if self.daemon.poll() is not None:
                raise RuntimeError(f"the daemon ended with {self.daemon.returncode}: {self.logged()[-3000:]}")
            return time.monotonic(), {}
        return time.monotonic(), {camera["id"]: camera for camera in answered.json()["cameras"]}

    def wait_until_live(self):
        end = time.monotonic() + 60
        while time.monotonic() < end:
            _, cameras = self.cameras()
            if all(cameras.get(of, {}).get("state") == "live" for of in ORDINARY):
                return
            time.sleep(0.2)
        raise RuntimeError(f"ordinary cameras are not live: {cameras}")

    def warm_up(self):
        """Has the daemon do once what it does for every camera, so that no bomb is charged with it."""
        for way, content in (("numbered", (".png", png(64, 64, zlib.compress(bytes(65 * 64))))), ("file", (".jpg", jpeg(64, 64, [99] * 64))),
                             ("http", answer("image/jpeg", jpeg(64, 64, [99] * 64)))):
            self.take(Bomb(f"sound-{way}", way, content, "^(live|ended)"), secs=3.0)
        self.settle()
        # JPEG over RTP has no room for more than 2040 pixels a side (RFC 2435).
        large = parts([jpeg(2040, 2040, [at % 200 + 20 for at in range(255 * 255)])])
        row, _ = self.take(Bomb("sound-large", "http", large, "^live"), secs=6.0)
        self.large_mib = float(row[3])
        print(f"a sound camera of 2040 x 2040 pixels costs {self.large_mib:.1f} MiB", flush=True)
        self.settle()

    def settle(self):
        seen, end = [], time.monotonic() + 15
        while time.monotonic() < end and (len(seen) < 8 or max(seen[-8:]) - min(seen[-8:]) > 2):
            seen.append(self.sampler.now)
            time.sleep(0.25)

    def put(self, bomb):
        source = bomb.source(self.folder / "media", self.ports)
        if bomb.way in self.ports:
            getattr(self, bomb.way).ways[bomb.name] = bomb.content
        return source

    def add(self, bomb, source):
        added = self.caller.put_new(f"/api/v1/cameras/{bomb.name}", {"source": source})
        if added.status != 201:
            raise RuntimeError(f"{bomb.name}: {added.status} {added.text}")

    def look(self, bomb, source):
        """Looks at a file before it is a camera's; what is wrong with the answer, or nothing."""
        looked = self.caller.post("/api/v1/sources/look", {"source": {"path": source["path"]}})
        detail = "; ".join(re.findall(r'"detail": ?"((?:[^"\\]|\\.)*)"', looked.text)) or looked.text[:200]
        is_fine = looked.status == 200 or re.search(bomb.right, detail)
        is_right = is_fine if "live" in bomb.right else looked.status >= 400 and re.search(bomb.right, detail)
        return f"{looked.status}", None if is_right else f"look: {looked.status} {detail or looked.why}"

    def watch(self, bombs, secs):
        """Watches cameras of bombs until all are right or the time is over; what each came to, and the rate of ordinary cameras."""
        (began, first), came = self.cameras(), {}
        while True:
            now, cameras = self.cameras()
            passed = now - began
            for bomb in bombs:
                camera = cameras.get(bomb.name)
                if camera and not came.get(bomb.name, (None,) * 3)[2]:
                    text = f"{camera['state']}: {camera['reason'] or '-'}"
                    came[bomb.name] = (passed, text, re.search(bomb.right, text) is not None and camera["state"] != "connecting" or
                                       camera["reason"] is not None and re.search(bomb.right, camera["reason"]) is not None)
            is_done = all(came.get(bomb.name, (0, "", False))[2] for bomb in bombs)
            if cameras and passed >= secs and (is_done or passed >= REASON_SECS + LOOK_SECS):
                break
            time.sleep(0.2)
        rates = [(cameras[of]["frames"] - first[of]["frames"]) / passed for of in ORDINARY]
        return came, min(rates)

    def take(self, bomb, secs):
        """Lets off one bomb and takes its camera away; a row of the table."""
        source = self.put(bomb)
        before, looked, wrong = self.sampler.begin(), "-", []
        if bomb.way in ("file", "numbered"):
            looked, fault = self.look(bomb, source)
            wrong += [fault] * (fault is not None)
        self.add(bomb, source)
        came, rate = self.watch([bomb], secs)
        rose, workers = self.sampler.most - before, self.sampler.most_workers
        self.caller.delete(f"/api/v1/cameras/{bomb.name}")
        passed, text, is_right = came.get(bomb.name, (REASON_SECS, "no state", False))
        wrong += [f"not right within {REASON_SECS:.0f} s: {text}"] * (not is_right)
        return self.judge(bomb, before, rose, workers, passed, text, looked, rate, wrong)

    def judge(self, bomb, before, rose, workers, passed, text, looked, rate, wrong):
        allowed = MOST_MIB + self.large_mib * bomb.is_large
        wrong += [f"RSS rose by {rose:.0f} MiB"] * (rose >= allowed)
        wrong += [f"ordinary cameras fell to {rate:.1f} Hz"] * (rate < LEAST_SHARE * RATE_HZ)
        size = "" if bomb.n_bytes is None else f", {bomb.n_bytes} B"
        return ([bomb.name, bomb.way + size, f"{before:.0f}", f"{rose:+.1f}", f"{workers:.0f}", shown(text, self), f"{passed:.1f}", looked,
                 f"{rate:.1f}", "wrong" if wrong else "right"], [f"{bomb.name}: {shown(what, self)}" for what in wrong])

    def one_by_one(self, bombs):
        for bomb in bombs:
            row, wrong = self.take(bomb, self.secs)
            self.rows.append(row)
            self.harms += wrong
            print(" | ".join(row), *wrong, sep="\n    " if wrong else "", flush=True)

    def all_at_once(self, bombs):
        self.settle()
        sources = [(bomb, self.put(bomb)) for bomb in bombs]
        before = self.sampler.begin()
        (began, first) = self.cameras()
        for bomb, source in sources:
            self.add(bomb, source)
        came, _ = self.watch(bombs, REASON_SECS)
        now, cameras = self.cameras()
        rate = min((cameras[of]["frames"] - first[of]["frames"]) / (now - began) for of in ORDINARY)
        n_right = sum(right for _, _, right in came.values())
        slowest = max((passed for passed, _, right in came.values() if right), default=0.0)
        wrong = [f"all at once: {bomb.name}: not right within {REASON_SECS:.0f} s: {shown(came.get(bomb.name, ('', 'no state'))[1], self)}"
                 for bomb in bombs if not came.get(bomb.name, (0, "", False))[2]]
        whole = Bomb("all at once", "all", None, "", any(bomb.is_large for bomb in bombs))
        row, more = self.judge(whole, before, self.sampler.most - before, self.sampler.most_workers, slowest,
                               f"{n_right} of {len(bombs)} right", "-", rate, [])
        self.rows.append(row[:-1] + ["wrong" if wrong or more else "right"])
        self.harms += wrong + more
        for bomb in bombs:
            self.caller.delete(f"/api/v1/cameras/{bomb.name}")

    def close(self):
        self.sampler.is_over.set()
        self.daemon.send_signal(signal.SIGTERM)
        try:
            status = self.daemon.wait(15)
        except subprocess.TimeoutExpired:
            self.daemon.kill()
            status = self.daemon.wait()
        self.harms += [f"the daemon ended with {status}"] * (status != 0)
        self.harms += [f"the daemon's log: {line}" for line in self.logged().splitlines() if "panicked" in line or "CRITICAL" in line][:5]
        self.log.close()


def shown(text, run):
    """Returns a text for a table, without folders and with a bounded length."""
    text = text.replace(f"{run.folder}/media/", "").replace("|", "/").replace("\n", " ")
    text = re.sub(r"; supported are .*", "", text)
    text = re.sub(r":(\d{4,5})\b", ":PORT", text)
    return text if len(text) <= 170 else text[:169] + "…"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--daemon", default="target/debug/videofields", help="the videofields binary (%(default)s)")
    parser.add_argument("--seconds", type=float, default=3.0, help="for how long each bomb is watched at least (%(default)s)")
    parser.add_argument("--only", help="bombs whose name has this in it")
    arguments = parser.parse_args()
    # A signal that ends the script ends its daemon and takes its folder away too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    began = time.monotonic()
    bombs = [bomb for bomb in [*file_bombs(), *http_bombs(), *rtsp_bombs()] if not arguments.only or arguments.only in bomb.name]
    with tempfile.TemporaryDirectory(prefix="videofields-bombs-") as folder:
        run = Run(arguments, pathlib.Path(folder))
        try:
            run.wait_until_live()
            run.warm_up()
            start = run.sampler.now
            run.one_by_one(bombs)
            run.all_at_once(bombs)
            run.settle()
            end = run.sampler.now
        finally:
            run.close()
    heads = ["bomb", "comes as", "RSS MiB", "rose MiB", "decoders MiB", "state and reason", "after s", "look", "ordinary Hz", "is"]
    print("", *("| " + " | ".join(row) + " |" for row in [heads, ["---"] * len(heads), *run.rows]), sep="\n")
    print(*(f"HARM: {harm}" for harm in run.harms), sep="\n")
    most = max(float(row[3]) for row in run.rows)
    slowest = min(float(row[8]) for row in run.rows)
    print(f"{len(bombs)} bombs: the daemon's RSS rose by {most:.1f} MiB at most ({start:.0f} MiB before all, {end:.0f} after), ordinary "
          f"cameras of {RATE_HZ:.0f} Hz gave {slowest:.1f} Hz at least, {len(run.harms)} faults, {time.monotonic() - began:.0f} s")
    return 1 if run.harms else 0


if __name__ == "__main__":
    sys.exit(main())
