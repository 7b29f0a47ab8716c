-- What settings cost on a machine and what error they leave; a cache, measured again in half a minute.
create table measured_cost (
    -- What tells one machine from another: SHA-256 of processor, adapter and program version, hexadecimal.
    machine text not null primary key check (length(machine) = 64),
    -- When it was measured: nanoseconds since 1970-01-01, UTC.
    measured_at integer not null,
    -- The table: JSON, UTF-8.
    document text not null check (json_valid(document))
) strict;
