-- Signatures (Ed25519) of entries of the audit log: each is of an entry's number and digest, and so of all entries before it.
-- Entries that were written without a key have none.
create table audit_signature (
    -- The entry.
    number integer primary key check (number >= 1),
    -- The public key that verifies it.
    key blob not null check (length(key) = 32),
    signature blob not null check (length(signature) = 64)
) strict;

create trigger audit_signature_is_not_changed before update on audit_signature
begin
    select raise(abort, 'the audit log is only ever added to');
end;

-- They go with their entries, for these's age.
create trigger audit_signature_is_not_shortened before delete on audit_signature
when old.number > (select number from audit_anchor)
begin
    select raise(abort, 'the audit log is only ever added to');
end;
