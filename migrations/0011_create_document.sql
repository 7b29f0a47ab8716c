-- What people change through the API and keep: scenes, views and walls, with every version of late. Cannot be rebuilt.
create table document (
    -- `scene`, `view` or `wall`.
    kind text not null check (kind in ('scene', 'view', 'wall')),
    id text not null check (length(id) between 1 and 64),
    -- 1 at first, and one more with every change, removal and return.
    version integer not null check (version >= 1),
    -- JSON, UTF-8; null where that change removed it.
    document text check (document is null or json_valid(document)),
    -- By the machine's clock, nanoseconds since 1970-01-01, UTC.
    changed_at integer not null,
    -- The user; null where there are no users.
    changed_by text,
    primary key (kind, id, version)
) strict, without rowid;
