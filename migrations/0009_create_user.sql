-- Who may ask the daemon for what. Cannot be rebuilt: on disk when a change is acknowledged.
create table user (
    -- Name by which the user logs in.
    id text primary key check (length(id) between 1 and 64),
    -- `viewer`, `operator` or `admin`.
    role text not null check (role in ('viewer', 'operator', 'admin')),
    -- Rights by camera as a JSON object: {"*": ["live"], "north": ["live", "history"]}.
    rights text not null check (json_valid(rights)),
    -- The password as Argon2id keeps it (PHC string); null for who has tokens alone.
    password text,
    -- 1 at first, and one more with every change.
    version integer not null check (version >= 1),
    -- Nanoseconds since 1970-01-01, UTC.
    created_at integer not null,
    updated_at integer not null
) strict;

-- What programs show in a user's place.
create table token (
    -- Its public part.
    id text primary key check (length(id) between 1 and 64),
    user text not null references user (id) on delete cascade,
    -- What it is for, in its maker's words.
    note text not null,
    -- SHA-256 of its secret part, which has 256 random bits and needs no slower one.
    digest blob not null check (length(digest) = 32),
    created_at integer not null,
    -- From when on it is not taken any more; null for never.
    expires_at integer
) strict;

create index token_by_user on token (user);
