#!/usr/bin/env python3
"""Users with few rights destroy no evidence: neither snapshots, nor exports, nor recordings of others.

The harm as it was: 60 snapshots of an operator pushed out three of the admin's, and an operator lifted the hold of a sealed snapshot
and deleted it. Recordings are tried too: an operator's camera whose clock is set a century ahead would be the newest for ever.
"""

import datetime
import sys
import time

from harness import Crowd, House, Report, arguments

ALL = "/api/v1/snapshots"
# Room for some forty snapshots of 640 x 360.
STORAGE = "snapshot_max_gib = 0.02\nsnapshot_min_free_mib = 0"


def instant(seconds_back):
    at = datetime.datetime.now(datetime.timezone.utc) - datetime.timedelta(seconds=seconds_back)
    return at.strftime("%Y-%m-%dT%H:%M:%S.%fZ")


def main():
    given = arguments(__doc__, 0.0)
    report = Report("Evidence stays", given.quick)
    n = 60 if given.quick else 200
    with House(given.daemon, storage=STORAGE) as house:
        root, olga, otto = (house.caller(user) for user in ("root", "olga", "otto"))
        figures = {"before": house.figures()}
        of_admin = [root.post(ALL, {"camera": "east"}).json()["id"] for _ in range(3)]
        sealed = root.post(ALL, {"camera": "east", "hold": True}).json()["id"]
        own_held = olga.post(ALL, {"camera": "west", "hold": True}).json()["id"]
        statuses = [olga.post(ALL, {"camera": "west", "note": "n" * 2000}).status for _ in range(n)]
        held = [olga.post(ALL, {"camera": "west", "hold": True}).status for _ in range(n // 2)]

        def flood(idx, crowd):
            crowd.count_answer(crowd_callers[idx].post(ALL, {"camera": "west", "hold": idx % 2 == 0}))
        crowd_callers = [house.caller(user, keep=True) for user in ("olga", "otto", "olga", "otto")]
        with Crowd("snapshots at once", 4, flood) as crowd:
            time.sleep(2 if given.quick else 15)
            counts = crowd.stop()
        figures["after"] = house.figures()
        report.say(f"{n} snapshots one after the other: {sorted(set(statuses))}; {n // 2} that are held: {sorted(set(held))}")
        report.counts("snapshots at once", counts)
        for of in [*of_admin, sealed, own_held]:
            verified = root.get(f"{ALL}/{of}/verification")
            report.check(verified.status == 200 and verified.json().get("is_whole") is True, f"snapshot {of[:8]} is there and whole",
                         f"snapshot {of[:8]}: {verified.status} {verified.text[:200]}")
        made = root.post(ALL, {"camera": "east"})
        report.check(made.status == 201, "the admin makes one more", f"the admin makes none: {made.status} {made.text[:200]}")
        made = house.caller("otto").post(ALL, {"camera": "west"})
        report.check(made.status in (201, 507), f"another operator is answered {made.status}", f"{made.status} {made.text[:200]}")
        for name, answer, expected in (
            ("an operator's lifting the hold of the admin's", olga.patch(f"{ALL}/{sealed}", {"hold": False}), (403,)),
            ("an operator's lifting the hold of its own", olga.patch(f"{ALL}/{own_held}", {"hold": False}), (403,)),
            ("an operator's removing a held one of the admin", olga.delete(f"{ALL}/{sealed}"), (403, 409)),
            ("an operator's removing a held one of its own", olga.delete(f"{ALL}/{own_held}"), (403, 409)),
            ("an operator's removing one of the admin", olga.delete(f"{ALL}/{of_admin[0]}"), (403,)),
            ("an operator's removing one of a camera that it may not see", otto.delete(f"{ALL}/{of_admin[1]}"), (404,)),
            ("a viewer's removing", house.caller("vera").delete(f"{ALL}/{of_admin[2]}"), (403, 404)),
        ):
            report.check(answer.status in expected, f"{name} is {answer.status}",
                         f"{name} is {answer.status} {answer.text[:200]}")
        exports(house, report, given.quick)
        history(house, report)
        removed = [entry for entry in house.audit() if "removed to make room" in entry["action"]]
        report.say(f"removals that nobody asked for, in the audit log: {len(removed)}")
        report.check(all(entry["user"] in ("olga", "otto") for entry in removed), "all of them were for those who flooded",
                     f"some were for others: {[entry for entry in removed if entry['user'] not in ('olga', 'otto')][:3]}")
        report.figures(figures)
        report.alive(house)
    return report.done()


def history(house, report):
    """An operator changes what an admin made so often that the first version is forgotten: 200 are kept (docs/api.md)."""
    root, otto = house.caller("root"), house.caller("otto", keep=True)
    root.put_new("/api/v1/views/gate", {"scene": "plaza", "name": "made by the admin"})
    n = sum(otto.patch("/api/v1/views/gate", {"name": str(idx)}).status == 200 for idx in range(210))
    first = root.get("/api/v1/views/gate/versions/1").status
    report.limit(f"after {n} changes of a named view by an operator the admin's first version is {first}")


def exports(house, report, is_quick):
    """An operator's exports push out none of the admin's."""
    root, olga = house.caller("root"), house.caller("olga")
    # Recordings have something to export after some seconds.
    time.sleep(max(0.0, house.ready_at + 10 - time.monotonic()))
    span = {"from": instant(8), "to": instant(1), "cameras": ["east"]}
    asked = root.post("/api/v1/exports", span)
    if asked.status not in (201, 202):
        report.check(False, "the admin's export is asked for", f"the admin's export is {asked.status} {asked.text[:200]}")
        return
    own, end = asked.json()["id"], time.monotonic() + 30
    while (state := root.get(f"/api/v1/exports/{own}").json().get("state")) not in ("done", "failed") and time.monotonic() < end:
        time.sleep(0.3)
    n = 40 if is_quick else 400
    statuses = {}
    for _ in range(n):
        answer = olga.post("/api/v1/exports", span | {"cameras": ["west"]})
        statuses[answer.status] = statuses.get(answer.status, 0) + 1
        if answer.status == 503:
            time.sleep(0.1)
    report.say(f"{n} exports of an operator: {statuses}")
    later = root.get(f"/api/v1/exports/{own}")
    report.check(state == "done" and later.status == 200 and later.json().get("state") == "done",
                 "the admin's export is still there", f"the admin's export: {state}, then {later.status} {later.text[:200]}")
    refused = olga.delete(f"/api/v1/exports/{own}")
    report.check(refused.status == 403, "an operator does not remove it", f"an operator's removing is {refused.status}")
    asked = root.post("/api/v1/exports", span)
    report.check(asked.status in (201, 202), "the admin asks for one more", f"the admin's next is {asked.status} {asked.text[:200]}")


if __name__ == "__main__":
    sys.exit(main())
