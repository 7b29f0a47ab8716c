-- Snapshots that people keep as evidence: the index of what lies in the folder of snapshots, the chain of their records, and
-- what was said of each since. Cannot be rebuilt: what was said stands here alone.
create table snapshot (
    -- 1, 2, 3, ... in the order in which they were sealed. Not told to callers: numbers count.
    number integer primary key check (number >= 1),
    -- Random, hexadecimal.
    id text not null unique check (length(id) = 32),
    -- By the machine's clock, nanoseconds since 1970-01-01, UTC.
    made_at integer not null,
    -- Scene time that it shows, nanoseconds since 1970-01-01, UTC.
    shown_at integer not null,
    -- What it shows: a view of a scene, or a camera's picture.
    kind text not null check (kind in ('scene', 'camera')),
    -- The scene's or camera's id.
    subject text not null,
    -- The user who asked; null where there are no users, or for the daemon's own.
    made_by text,
    -- The schedule that made it; null where somebody asked.
    schedule text,
    -- Of all its files; 0 once it was removed.
    bytes integer not null check (bytes >= 0),
    -- SHA-256 of its record.
    digest blob not null unique check (length(digest) = 32),
    -- SHA-256 of the record before; 32 zeros for the first.
    previous blob not null check (length(previous) = 32),
    -- Random: hashed with `previous` into what the record says of the one before.
    salt blob not null check (length(salt) = 32),
    -- Of the newest of its annotations, whose members stand beside it.
    version integer not null check (version >= 1),
    note text not null,
    -- A JSON list of texts.
    tags text not null check (json_valid(tags)),
    -- Whether it stays, however old.
    hold integer not null check (hold in (0, 1)),
    -- When it was removed; null while it is there. The row stays, so that the chain is whole.
    removed_at integer,
    removed_by text,
    -- Why: somebody asked, all together were too large, or it was too old.
    removed_for text check (removed_for in ('asked', 'bytes', 'age')),
    check ((removed_at is null) = (removed_for is null))
) strict;

-- The cameras in it; who may not see one of them does not see it.
create table snapshot_camera (
    number integer not null references snapshot (number) on delete cascade,
    camera text not null,
    primary key (number, camera)
) strict, without rowid;

-- What was said of it, every version; 1 is what was said when it was made.
create table snapshot_annotation (
    number integer not null references snapshot (number) on delete cascade,
    version integer not null check (version >= 1),
    -- By the machine's clock, nanoseconds since 1970-01-01, UTC.
    at integer not null,
    -- The user; null where there are no users, or for the daemon's own.
    by text,
    note text not null,
    tags text not null check (json_valid(tags)),
    hold integer not null check (hold in (0, 1)),
    primary key (number, version)
) strict, without rowid;

create index snapshot_made on snapshot (made_at, number) where removed_at is null;
