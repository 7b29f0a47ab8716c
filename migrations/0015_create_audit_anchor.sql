-- Where the audit log begins once its oldest rows were removed for their age: the last removed row's number and digest, so
-- that the chain of those that are left is proved from here. One row.
create table audit_anchor (
    id integer primary key check (id = 1),
    -- The last row that was removed; 0 where none was.
    number integer not null check (number >= 0),
    -- Its digest; 32 zeros where none was, which is what the first row's digest begins with.
    digest blob not null check (length(digest) = 32)
) strict;

insert into audit_anchor (id, number, digest) values (1, 0, zeroblob(32));

-- It moves on alone, and to a row that is there.
create trigger audit_anchor_moves_on before update on audit_anchor
when new.number <= old.number or new.digest is not (select digest from audit where number = new.number)
begin
    select raise(abort, 'the audit log begins later only, at an entry that is there');
end;

create trigger audit_anchor_stays before delete on audit_anchor
begin
    select raise(abort, 'the audit log has a beginning');
end;

drop trigger audit_is_not_shortened;

create trigger audit_is_not_shortened before delete on audit
when old.number > (select number from audit_anchor)
begin
    select raise(abort, 'the audit log is only ever added to');
end;
