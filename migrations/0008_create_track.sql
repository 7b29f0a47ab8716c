-- Where what moved before a camera went, one row a thing that was followed, so that who was where can be asked for long
-- after the pictures are gone. Bounded in rows and in age for each camera.
create table track (
    -- The camera's id.
    camera text not null check (length(camera) between 1 and 64),
    -- Order of writing among the camera's: greater is later. A count and not a time, because clocks step and clips begin
    -- again.
    written integer not null,
    -- Scene time of the first and of the last sighting: nanoseconds since 1970-01-01, UTC.
    began_at integer not null,
    ended_at integer not null check (ended_at >= began_at),
    -- Its number among those of one run of the camera; the next run begins anew.
    number integer not null check (number >= 0),
    -- The least box around its feet in the texture, 0 at the left and top to 65535 at the right and bottom.
    min_u integer not null check (min_u between 0 and 65535),
    min_v integer not null check (min_v between 0 and 65535),
    max_u integer not null check (max_u between min_u and 65535),
    max_v integer not null check (max_v between min_v and 65535),
    -- Its largest height, 65535 being the picture's.
    height integer not null check (height between 0 and 65535),
    -- When its feet were where, encoded by `track`. Last, so that the other columns are read without it.
    path blob not null check (length(path) between 1 and 8192),
    primary key (camera, began_at, number),
    unique (camera, written)
) strict;

-- How far before a span of time the tracks begin that reach into it: as far as the longest is long.
create index track_by_length on track (camera, ended_at - began_at);
