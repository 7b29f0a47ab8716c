-- Backgrounds of the past, so that looking back can segment with the background of that time; bounded in rows and
-- bytes, and cannot be made again once the pictures are gone.
create table background_history (
    -- Order of writing: greater is later. A count and not a time, because clocks step and clips begin again.
    written integer not null primary key,
    -- The camera's id.
    camera text not null check (length(camera) between 1 and 64),
    -- Columns of the camera's picture, pixels.
    width integer not null check (width between 1 and 65536),
    -- Rows of the camera's picture, pixels.
    height integer not null check (height between 1 and 65536),
    -- Colour matrix of the picture.
    matrix text not null check (matrix in ('bt601', 'bt709', 'bt2020')),
    -- Version of the encoding of `bytes`.
    version integer not null check (version between 0 and 4294967295),
    -- Scene time of the last frame that was learned: nanoseconds since 1970-01-01, UTC.
    saved_at integer not null,
    -- The encoded Gaussian mixture. Last, so that the other columns are read without it.
    bytes blob not null,
    unique (camera, saved_at)
) strict;
