-- Documents of further kinds: what was changed of cameras, and playheads. Which kinds there are the program says.
create table wider_document (
    -- `scene`, `view`, `wall`, `camera`, `playhead`, ...
    kind text not null check (length(kind) between 1 and 32),
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

insert into wider_document (kind, id, version, document, changed_at, changed_by)
select kind, id, version, document, changed_at, changed_by from document;

drop table document;

alter table wider_document rename to document;
