-- How much moved before a camera, minute by minute, so that a timeline of weeks is drawn without looking at pictures.
create table activity (
    -- The camera's id.
    camera text not null check (length(camera) between 1 and 64),
    -- Scene time: whole minutes since 1970-01-01, UTC.
    minute integer not null,
    -- Frames looked at in that minute.
    n_frames integer not null check (n_frames > 0),
    -- Share of the picture that moved, 0 to 1: summed over the frames, so that parts of a minute can be added.
    moving_sum real not null check (moving_sum >= 0),
    -- Most things that moved at once.
    max_tracks integer not null check (max_tracks >= 0),
    -- Things that came in that minute.
    new_tracks integer not null check (new_tracks >= 0),
    primary key (camera, minute)
) strict, without rowid;

create index activity_by_minute on activity (minute);
