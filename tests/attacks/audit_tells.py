#!/usr/bin/env python3
"""The audit log says who logged in and at which time of the past somebody looked, and nobody changes it unnoticed.

The harm as it was: a log-in was noted without a name, looks at the past without their time, and whoever had the database's file
rewrote lines and computed all digests anew. Lines are changed, removed, put in and cut off; each must be told.
"""

import hashlib
import shutil
import sqlite3
import sys
import time

from harness import House, Report, arguments
from harness.house import PASSWORD


# Has all digests computed anew, so that they fit what stands in the log.
ANEW = "digests anew"


def compute_digests(connection):
    """Computes the digest of every entry as the daemon does, from its own and the one before."""
    before = b"\0" * 32
    rows = connection.execute("select number, at, user, action, target, status from audit order by number").fetchall()
    connection.execute("update audit set digest = randomblob(32)")
    for number, at, user, action, target, status in rows:
        parts = [before, number.to_bytes(8, "big"), at.to_bytes(8, "big", signed=True), status.to_bytes(2, "big"),
                 bytes([user is not None])]
        for text in (user or "", action, target):
            parts += [len(text.encode()).to_bytes(8, "big"), text.encode()]
        before = hashlib.sha256(b"".join(parts)).digest()
        connection.execute("update audit set digest = ? where number = ?", (before, number))


def forge(database, sql):
    """Changes the log as somebody who has the file would: without the triggers that refuse it."""
    connection = sqlite3.connect(database, timeout=10)
    try:
        triggers = connection.execute("select name from sqlite_master where type = 'trigger' and tbl_name like 'audit%'").fetchall()
        for (name,) in triggers:
            connection.execute(f'drop trigger "{name}"')
        for one in sql:
            if one == ANEW:
                compute_digests(connection)
            else:
                connection.execute(one)
        connection.commit()
    finally:
        connection.close()


def main():
    given = arguments(__doc__, 0.0)
    report = Report("The audit log tells", given.quick)
    with House(given.daemon, sign=True) as house:
        root = house.caller("root")
        house.log_in("olga", PASSWORD, "127.0.0.7")
        house.log_in("olga", "wrong password!", "127.0.0.8")
        time.sleep(6)
        first = root.get("/api/v1/cameras/west").json()["first"]
        looks = {
            "a camera's picture": f"/api/v1/cameras/west/frame.jpg?t={first}",
            "a view": f"/api/v1/scenes/plaza/view.jpg?width=64&height=36&t={first}",
            "a strip": f"/api/v1/cameras/west/strip.jpg?from={first}&to={root.get('/api/v1/cameras/west').json()['last']}&count=2",
            "tracks": f"/api/v1/scenes/plaza/tracks?from={first}&to={root.get('/api/v1/cameras/west').json()['last']}",
        }
        vera = house.caller("vera")
        met = {name: vera.get(path).status for name, path in looks.items()}
        vera.post("/api/v1/snapshots", {"camera": "west"})
        entries = house.audit()
        log_in = [entry for entry in entries if entry["action"] == "POST /api/v1/session" and entry["status"] == 200]
        report.check(bool(log_in) and log_in[-1]["user"] == "olga" and "from=127.0.0.7" in log_in[-1]["target"],
                     "a log-in is noted with name and address", f"a log-in is noted as {log_in}")
        failed = [entry for entry in entries if entry["action"] == "POST /api/v1/session" and entry["status"] == 401]
        report.check(bool(failed), "a log-in that failed is noted", "a log-in that failed is not noted")
        for name, path in looks.items():
            noted = [entry for entry in entries if entry["user"] == "vera" and entry["target"].startswith(path.split("?")[0])]
            report.check(met[name] == 200 and bool(noted) and "shown=" in noted[-1]["target"],
                         f"a look at the past of {name} carries the time that was looked at", f"{name}: {met[name]} {noted}")
        report.check(any(entry["user"] == "vera" and entry["status"] == 403 for entry in entries), "what was refused is noted too")

        fault = (root.get("/api/v1/system").json().get("audit") or {}).get("fault")
        report.check(fault is None, "of a log that nobody changed the daemon tells no fault", f"nobody changed the log, and the daemon tells: {fault}")

        # Somebody opens the database beside the daemon.
        database, public = house.folder / "attacks.sqlite", house.folder / "audit.key.pub"
        verified = verify(house, public)
        report.check(verified.returncode == 0, "the log as it was written is verified",
                     f"the log as it was written is not: {verified.stdout}{verified.stderr}")
        newest = house.audit()[-1]["number"]
        forge(database, [f"update audit set user = 'nobody' where number = {newest}", ANEW])
        end, found = time.monotonic() + 30, fault
        while found == fault and time.monotonic() < end:
            root.post("/api/v1/tokens", {"note": "one more line"})
            time.sleep(1)
            found = (root.get("/api/v1/system").json().get("audit") or {}).get("fault")
        report.check(found != fault, f"the running daemon tells: {found}", "the running daemon tells of no change within 30 s")
        verified = verify(house, public)
        report.check(verified.returncode != 0, f"verify tells of a changed line: {last(verified)}", "verify does not tell")
    with House(given.daemon, sign=True) as house:
        house.log_in("olga", PASSWORD, "127.0.0.7")
        house.caller("vera").get("/api/v1/cameras/west/frame.jpg")
        house.stop()
        public = house.folder / "audit.key.pub"
        verified = verify(house, public)
        report.check(verified.returncode == 0, "the log of a daemon that was stopped is verified", f"it is not: {last(verified)}")
        offline(house, report, public)
    return report.done()


def verify(house, public, *more):
    return house.command("audit", "--config", str(house.config), "verify", "--public-key", str(public), *more, check=False)


def last(done):
    return ((done.stderr or done.stdout).strip().splitlines() or [""])[-1][:160]


def offline(house, report, public):
    """Changes a log that no daemon has open, each time of a good copy."""
    database = house.folder / "attacks.sqlite"
    connection = sqlite3.connect(database)
    connection.execute("pragma wal_checkpoint(truncate)")
    top = connection.execute("select max(number) from audit").fetchone()[0]
    connection.close()
    kept = house.folder / "kept"
    kept.mkdir()
    shutil.copy(database, kept / "attacks.sqlite")
    changes = {
        "the last line cut off": [f"delete from audit where number = {top}"],
        "the last five lines cut off": [f"delete from audit where number > {top - 5}"],
        "a line removed": [f"delete from audit where number = {top - 3}"],
        "the first lines removed": ["delete from audit where number < 5"],
        "a line changed": [f"update audit set user = 'vera' where number = {top // 2}"],
        "a line changed, and all digests computed anew": [f"update audit set user = 'vera' where number = {top // 2}", ANEW],
        "a line changed, all digests computed anew, all signatures removed": [
            f"update audit set user = 'vera' where number = {top // 2}", ANEW, "delete from audit_signature"],
        "a line put in at the end": [
            f"insert into audit select {top + 1}, at, user, action, target, status, randomblob(32) from audit where number = {top}", ANEW],
        "all lines removed": ["delete from audit"],
        "a time changed": [f"update audit set at = at + 1 where number = {top - 1}"],
        "two lines exchanged": ["update audit set number = 1000000 where number = 3", "update audit set number = 3 where number = 4",
                                "update audit set number = 4 where number = 1000000", ANEW],
        "all signatures removed": ["delete from audit_signature"],
    }
    for name, sql in changes.items():
        for path in house.folder.glob("attacks.sqlite-*"):
            path.unlink()
        shutil.copy(kept / "attacks.sqlite", database)
        try:
            forge(database, sql)
        except sqlite3.Error as error:
            report.check(True, f"{name}: SQLite itself refuses ({error})")
            continue
        verified = verify(house, public)
        report.check(verified.returncode != 0, f"{name}: verify says {last(verified)!r}", f"{name}: verify does not tell: {last(verified)}")


if __name__ == "__main__":
    sys.exit(main())
