-- Who was where in a scene, as it was concluded from a set of its cameras, so that the past has the ids that the present had. What was
-- concluded from other cameras of the scene is another set.
create table entity_set (
    id integer primary key,
    -- The scene's id.
    scene text not null check (length(scene) between 1 and 64),
    -- The cameras' ids in the scene's order, with commas between them.
    cameras text not null check (length(cameras) between 1 and 65536),
    -- The least id that was not handed out; none is handed out twice.
    next_id integer not null check (next_id > 0),
    unique (scene, cameras)
) strict;

-- A time of which it is known who was where. Of two spans of a set that overlap, the one that was begun later counts: clocks step and
-- clips begin again.
create table entity_span (
    -- Never that of another, so that nothing goes on a span that is gone.
    id integer primary key autoincrement,
    entity_set integer not null references entity_set (id) on delete cascade,
    -- Scene time: nanoseconds since 1970-01-01, UTC.
    began_at integer not null,
    ended_at integer not null check (ended_at >= began_at)
) strict;

create index entity_span_by_set on entity_span (entity_set, ended_at);

-- Somebody or something that was there, one row for each time that it was seen without a longer break.
create table entity (
    entity_span integer not null references entity_span (id) on delete cascade,
    -- Scene time of the first and of the last sighting.
    began_at integer not null,
    ended_at integer not null check (ended_at >= began_at),
    -- Its id within the set.
    id integer not null check (id >= 0),
    height_mm integer not null check (height_mm between 0 and 1000000),
    -- When it was where and which cameras saw it, encoded by `fuse`. Last, so that the other columns are read without it.
    path blob not null check (length(path) between 1 and 65536),
    primary key (entity_span, began_at, id)
) strict;

-- How far before a time the sightings begin that reach into it: as far as the longest is long.
create index entity_by_length on entity (entity_span, ended_at - began_at);
