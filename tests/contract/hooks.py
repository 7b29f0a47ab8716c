"""What Schemathesis cannot know of videofields: names of what is there, streams without end, and rules beyond schemas.

Every hook says what it does to a case, and what is done is counted: tests/contract/run.sh prints the counts.
"""

import atexit
import collections
import json
import os
import re
import threading
import time
import zlib

import requests.adapters
import schemathesis

LOCK = threading.Lock()
COUNTS = collections.Counter()


def count(what):
    with LOCK:
        COUNTS[what] += 1


@atexit.register
def write_counts():
    path = os.environ.get("CONTRACT_COUNTS")
    if path:
        with open(path, "w", encoding="utf-8") as file:
            json.dump(COUNTS, file, indent=2, sort_keys=True)


# What is there ------------------------------------------------------------------------------------------------------------
# Names that fit the pattern are hardly ever names of anything. Three of four that are well formed become one of these, chosen by
# what was generated, so that a case stays the same case. What does not fit its pattern stays as it is.
THERE = {
    "cameras": ["west", "east", "north", "spare", "west"],
    "calibrations": ["west", "east", "north", "spare", "west"],
    "scenes": ["plaza", "plaza", "spare"],
    "walls": ["control", "spare"],
    "views": ["gate", "spare"],
    "playheads": ["wall", "spare"],
    "users": ["root", "olga", "vera", "spare"],
    "exports": [os.environ.get("CONTRACT_EXPORT", "none")],
    "snapshots": [os.environ.get("CONTRACT_SNAPSHOT", "none")],
    "tiles": ["r1c1", "r1c2"],
    "versions": ["1"],
}
ID = re.compile(r"[a-z0-9][a-z0-9_-]{0,63}")


def owner(path, name):
    """The segment before the one of that name."""
    found = re.search(r"/([a-z-]+)/\{" + re.escape(name) + r"\}", path)
    return found and found.group(1)


def chosen(value, among):
    number = zlib.crc32(str(value).encode())
    return value if number % 4 == 0 else among[number // 4 % len(among)]


@schemathesis.hook
def map_path_parameters(context, path_parameters):
    if not path_parameters or context.operation is None:
        return path_parameters
    for name, value in list(path_parameters.items()):
        among = THERE.get(owner(context.operation.path, name))
        if among and isinstance(value, (str, int)) and ID.fullmatch(str(value)):
            path_parameters[name] = chosen(value, among)
    return path_parameters


@schemathesis.hook
def map_headers(context, headers):
    """Half of the versions that are named become `*`, since no generated one is ever there; of two conditions one is taken."""
    if not headers:
        return headers
    named = headers.get("If-Match")
    if isinstance(named, str) and re.fullmatch(r'"[!#-~]{1,64}"', named) and zlib.crc32(named.encode()) % 2:
        headers["If-Match"] = "*"
    if headers.get("If-None-Match") == "*" and isinstance(named, str):
        del headers["If-None-Match"]
    return headers


# What must stay -----------------------------------------------------------------------------------------------------------
# A change of these would end the run, or leave nothing to look at: it is made to what stands beside them for that.
KEPT = {
    "users": ({"root", "olga", "vera"}, "spare"),
    "tokens": (set(os.environ.get("CONTRACT_TOKENS", "").split()), os.environ.get("CONTRACT_SPARE_TOKEN", "none")),
    "scenes": ({"plaza"}, "spare"),
    "walls": ({"control"}, "spare"),
    "views": ({"gate"}, "spare"),
    "cameras": ({"west", "east", "north"}, "spare"),
    "calibrations": ({"west", "east", "north"}, "spare"),
    "exports": ({os.environ.get("CONTRACT_EXPORT")}, "none"),
    "snapshots": ({os.environ.get("CONTRACT_SNAPSHOT")}, "0" * 32),
}


# What each projection takes beside what all do; without one it is a perspective.
PROJECTIONS = {
    "perspective": {"eye", "target", "fov"},
    "orthographic": {"eye", "target", "across"},
    "map": {"target", "across", "heading"},
    "panorama": {"eye", "target", "fov", "span"},
    "stereo": {"eye", "target", "fov", "eye_distance", "convergence"},
    "window": {"eye", "window"},
}
OF_SOME = set().union(*PROJECTIONS.values())


def suit(query):
    """Takes out of a view's parameters those that mean nothing beside the others, or nothing would ever be drawn."""
    taken = PROJECTIONS.get(query.get("projection", "perspective"), OF_SOME)
    drop = (OF_SOME - taken) | ({"deadline_ms"} if "quality" in query else set())
    drop |= {"stride"} if query.get("entities") != "points" else {"sources"}
    drop |= {"sources"} if query.get("entities", "billboards") != "billboards" else set()
    if query.get("projection") == "window" and "window" not in query:
        drop.add("projection")
    for name in drop & set(query):
        del query[name]


@schemathesis.hook
def before_call(context, case, kwargs):
    mode = case.meta and case.meta.generation.mode
    if mode is not None and mode.is_positive and isinstance(case.query, dict):
        takes = {parameter.name for parameter in case.operation.query}
        # One of eight stays as it was generated, so that the refusals are tried too.
        if "projection" in takes and zlib.crc32(repr(sorted(case.query.items())).encode()) % 8:
            suit(case.query)
            count("views with parameters that suit each other")
    path = case.operation.path
    parts = path.split("/")
    if case.method.upper() not in ("GET", "HEAD", "OPTIONS", "TRACE") and len(parts) > 4 and parts[3] in KEPT:
        names, instead = KEPT[parts[3]]
        name = "camera" if parts[3] == "calibrations" else "id"
        if case.path_parameters.get(name) in names:
            case.path_parameters[name] = instead
            count("changes of what must stay, made elsewhere")
    if "101" in case.operation.responses.status_codes and case.method.upper() == "GET":
        # A WebSocket is asked for as one; HTTP clients cannot describe these fields otherwise than here.
        fields = {
            "Connection": "Upgrade",
            "Upgrade": "websocket",
            "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
        }
        case.headers = {**fields, **(case.headers or {})}


@schemathesis.hook
def after_call(context, case, response):
    count("cases")
    count(f"status {response.status_code}")


# Streams without end ------------------------------------------------------------------------------------------------------
# Of a stream of pictures the first part is read, of a WebSocket the answer that begins it: status, fields and media type are
# checked as any others'. What comes behind is tried by the suite (streams, sockets).
SEND = requests.adapters.HTTPAdapter.send
MOST_BYTES = 4 << 20


def first_part(media_type, raw):
    """The first part of `multipart/x-mixed-replace`, which must begin with its boundary."""
    boundary = re.search(r'boundary="?([^";]+)', media_type).group(1).encode()
    deadline = time.monotonic() + 15
    body = b""
    while len(body) < MOST_BYTES and time.monotonic() < deadline:
        piece = raw.read1(1 << 16)
        if not piece:
            break
        body += piece
        if body.count(b"--" + boundary) > 1:
            break
    if body and not body.lstrip(b"\r\n").startswith(b"--" + boundary):
        raise AssertionError(f"a stream of pictures begins with {body[:80]!r}, not with its boundary")
    return body


class Beginning:
    """A body that ends after its first part. It is read behind the answer's beginning, whose time is held to a limit."""

    def __init__(self, response):
        self.response, self.whole = response, response.raw

    def __getattr__(self, name):
        return getattr(self.whole, name)

    def stream(self, *_args, **_kwargs):
        yield first_part(self.response.headers["content-type"], self.whole)
        self.whole.close()


def send(self, request, **kwargs):
    response = SEND(self, request, **kwargs)
    if response.status_code == 101:
        response._content = b""
        count("WebSockets begun")
        response.close()
    elif response.headers.get("content-type", "").startswith("multipart/x-mixed-replace"):
        response.raw = Beginning(response)
        count("streams of pictures begun")
    return response


requests.adapters.HTTPAdapter.send = send


# Rules beyond schemas -----------------------------------------------------------------------------------------------------
# Where a request fits its schema and is refused all the same (400), every place that the problem document names must be one of
# these: rules between members, or within texts, that JSON Schema has no words for. Anything else is a failure.
RULES = [
    # A cursor is what an answer gave: nobody makes one up.
    r"must be what an answer gave as next",
    # Parameters that only go with others.
    r"means nothing to projection=",
    r"means something to entities=",
    r"means something with .* alone",
    r"cannot be asked for together with quality",
    r"eye and target must be at least",
    r"must be [0-9.e]+ to [0-9.e]+ metres wide and high",
    r"leaves the picture more than [0-9.e]+ metres high",
    r"is required$",
    r"must be after from",
    r"must be at least [0-9]+ s for so long a time",
    r"cannot stand beside If-Match",
    # Corners of a region that lie on one another or whose edges cross.
    r"must be x,y;x,y;x,y: .* without edges that cross",
    # A playhead or camera of that name is not there.
    r"there is no playhead",
    r"unknown camera of the scene",
    # Texts of calibrations say by themselves what they are, or nothing can be made of them.
    r"the format is none of",
    # What a text has no camera of, and what lies where nobody may look.
    r"no camera is named",
    r"the json format is in metres",
    r"lies outside the media roots",
    # Bytes that are not what a file's name says.
    r"^this is no .*, though the file's name says so$",
    # A frame of a wall that is not due for long.
    r"is due in [0-9.]+s; at most",
    # Years that nanoseconds in 64 bits do not reach.
    r'must be .*RFC 3339 instant.*not "(0|1[0-5]|16[0-7]|22[6-9]|2[3-9]|[3-9])[0-9]+-',
]
# Whole documents have more rules between their parts than can be listed (docs/scenes.md, docs/api.md): what stands in the body
# (a pointer) may be at fault in these.
DOCUMENTS = {
    "put_scene", "change_scene", "import_scene", "put_wall", "change_wall", "put_named_view", "change_named_view",
    "put_privacy", "change_privacy", "change_source", "change_segment", "put_user", "put_calibration", "put_playhead", "change_playhead",
    "ask_export", "make_snapshot", "annotate_snapshot", "add_token", "read_calibration", "look_at_source",
    "discover_cameras", "solve_calibration", "turn_calibration",
}


def is_beyond_schemas(case, response):
    try:
        errors = json.loads(response.content).get("errors") or []
    except ValueError:
        return False
    operation = case.operation.definition.raw.get("operationId")
    def known(error):
        in_body = operation in DOCUMENTS and "pointer" in error
        return in_body or any(re.search(rule, error["detail"]) for rule in RULES)
    return bool(errors) and all(map(known, errors))


def tell(case, response):
    """Counts which rules they were, operation by operation."""
    operation = case.operation.definition.raw.get("operationId")
    for error in json.loads(response.content)["errors"]:
        place = re.sub(r"/[0-9]+", "/N", error.get("pointer", error.get("parameter", "")))
        count(f"rule: {operation} {place}: {re.sub(r'[0-9.]+', 'N', error['detail'])[:60]}")


@schemathesis.hook
def filter_failure(context, failure, case, response):
    if type(failure).__name__ == "RejectedPositiveData" and response.status_code == 400:
        if is_beyond_schemas(case, response):
            count("refused by a rule beyond schemas")
            tell(case, response)
            return False
    return True
