-- Instant at which each file was begun, so that what goes for room goes in the order of writing: scene time is what a camera's
-- source and clock say. Nanoseconds since 1970-01-01, UTC, by the machine's clock.
alter table segment add column written_at integer not null default 0;

-- Files that are there have nothing but their scene time; none was written later than now.
update segment set written_at = min(last_at, cast(unixepoch('now') as integer) * 1000000000);

drop index segment_by_age;
create index segment_by_age on segment (min(last_at, written_at));
create index segment_by_writing on segment (written_at, id);
