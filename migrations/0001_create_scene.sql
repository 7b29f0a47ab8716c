-- Marks the file as ours ("vfld"), so that another program's database is never written to.
pragma application_id = 1986423908;

-- Scene documents; cannot be rebuilt from anything else.
create table scene (
    -- As the API names it: 1 to 64 of a-z, 0-9, - and _.
    id text not null primary key check (length(id) between 1 and 64),
    -- The normalised document: JSON, UTF-8.
    document text not null check (json_valid(document)),
    -- SHA-256 of the document's bytes, lower-case hexadecimal.
    digest text not null check (length(digest) = 64),
    -- When the document was written: nanoseconds since 1970-01-01, UTC.
    updated_at integer not null
) strict;
