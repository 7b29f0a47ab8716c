-- Who did what, in the order in which it happened; only ever added to. Each row holds a digest of itself and of the row
-- before, so that a row that is changed, taken out or put in shows.
create table audit (
    -- 1, 2, 3, ... without gaps.
    number integer primary key check (number >= 1),
    -- By the machine's clock, nanoseconds since 1970-01-01, UTC.
    at integer not null,
    -- The user; null where there are no users, or for a stranger.
    user text,
    -- What was done: a method and a route's template, such as `PUT /api/v1/users/{id}`.
    action text not null,
    -- To what: path and query.
    target text not null,
    -- What came of it: the answer's HTTP status.
    status integer not null check (status between 100 and 599),
    -- SHA-256 of the digest before (32 zeros for the first) and of this row.
    digest blob not null unique check (length(digest) = 32)
) strict;

create trigger audit_is_not_changed before update on audit
begin
    select raise(abort, 'the audit log is only ever added to');
end;

create trigger audit_is_not_shortened before delete on audit
begin
    select raise(abort, 'the audit log is only ever added to');
end;
