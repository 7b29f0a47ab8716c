-- Holds of snapshots: who put each, so that what users hold is counted by user; and who asked to lift one, where that takes two
-- admins.
alter table snapshot add column held_by text check (held_by is null or hold = 1);

-- The admin who asked to lift the hold, and until when another may confirm it, nanoseconds since 1970-01-01, UTC; null while
-- nobody has.
alter table snapshot add column lift_asked_by text check (lift_asked_by is null or hold = 1);
alter table snapshot add column lift_until integer check ((lift_until is null) = (lift_asked_by is null));

-- Whether that version asked to lift the hold.
alter table snapshot_annotation add column asks_lift integer not null default 0 check (asks_lift in (0, 1));

-- Who held what is held by now: the author of the first version since it was last not held.
update snapshot set held_by = (
    select annotation.by from snapshot_annotation as annotation
    where annotation.number = snapshot.number and annotation.version > coalesce(
        (select max(version) from snapshot_annotation where number = snapshot.number and hold = 0), 0)
    order by annotation.version limit 1)
where hold = 1 and removed_at is null;

-- Whose snapshots there are, the oldest first; and who holds them.
create index snapshot_owner on snapshot (made_by, made_at, number) where removed_at is null;
create index snapshot_holder on snapshot (held_by) where removed_at is null and hold = 1;
