-- Recorded stretches of cameras' streams, one row a file of the archive. The files are what counts: a row can be made
-- again by reading its file, so it may lag behind but must never say more than is on the disk.
create table segment (
    -- Order of writing, never given twice.
    id integer not null primary key autoincrement,
    -- The camera's id.
    camera text not null check (length(camera) between 1 and 64),
    -- The file, from the archive's folder on; `/` between its parts.
    path text not null unique check (length(path) between 1 and 1024),
    -- Scene time of the first frame and of the newest: nanoseconds since 1970-01-01, UTC.
    first_at integer not null,
    last_at integer not null check (last_at >= first_at),
    -- Frames in the bytes below.
    n_frames integer not null check (n_frames >= 0),
    -- Bytes of the file that are whole and on the disk; what lies behind them is not read.
    n_bytes integer not null check (n_bytes >= 0),
    -- Bytes of the file before its first cluster.
    header_bytes integer not null check (header_bytes between 0 and n_bytes),
    -- The codec's media type, such as video/x-h264.
    codec text not null,
    -- Columns and rows of the picture, pixels; 0 where the stream does not say them.
    width integer not null check (width between 0 and 65536),
    height integer not null check (height between 0 and 65536),
    -- open: being written. closed: whole. missing: there is no file. quarantined: the file cannot be read and was put
    -- aside. deleting: the file is to go, or gone.
    state text not null check (state in ('open', 'closed', 'missing', 'quarantined', 'deleting')),
    -- Where clusters begin that begin with a key frame, and the key frame's time, encoded by the archive. Last, so that
    -- the other columns are read without it.
    keys blob not null
) strict;

create index segment_by_camera_and_time on segment (camera, first_at);
create index segment_by_age on segment (last_at);
create index segment_by_state on segment (state) where state <> 'closed';
