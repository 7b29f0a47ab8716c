-- What nobody may see of the cameras' pictures, every change of late. Cannot be rebuilt.
create table privacy (
    camera text not null check (length(camera) between 1 and 64),
    -- 1 at first, and one more with every change, of the configuration too.
    version integer not null check (version >= 1),
    -- The zones that were asked for, a JSON list; null where those of the configuration hold.
    zones text check (zones is null or json_valid(zones)),
    -- The zones that came in force with it, a JSON list.
    in_force text not null check (json_valid(in_force)),
    -- Zones that were in force before, and until when: a JSON list.
    lifted text not null check (json_valid(lifted)),
    -- By the machine's clock, nanoseconds since 1970-01-01, UTC.
    changed_at integer not null,
    -- The user; null where there are no users, and where the configuration was changed.
    changed_by text,
    primary key (camera, version)
) strict, without rowid;
