//! Who asks: users with roles and rights, their tokens and their sessions; and what they did.
//!
//! In: names, passwords, tokens, session keys. Out: a [`Caller`] with [`Grants`], or why there is none. Users and tokens are
//! kept in the store, durable before a change is acknowledged, and in memory, where every request finds them; sessions in
//! memory alone. While there is no user at all everybody is an admin: the daemon then listens on loopback addresses only.

mod anchor;
mod audit;
mod document;
mod error;
mod secret;
mod throttle;

pub use anchor::{Anchor, AnchorError};
pub use audit::{Audit, MAX_PARTS_EACH, Once, OnceKind, Unwritten};
pub use document::{TokenSummary, UserChange, UserSummary};
pub use error::AccountError;
pub use secret::NoRandomness;
pub use throttle::Attempt;

use crate::store::{Store, StoreError, TokenRecord, UserRecord};
use document::User;
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::time::Duration;
use throttle::Throttle;
use tokio::sync::Semaphore;
use videofields_vision::access::{Grants, Role};
use videofields_vision::clock::{Clock, Timestamp};

/// How long a session lasts, however busy.
pub const SESSION_TIME: Duration = Duration::from_secs(12 * 3600);

/// Most users and tokens.
const MAX_USERS: usize = 1024;
const MAX_TOKENS: usize = 4096;

/// Tokens of one user, as far as it makes them itself, and those beyond [`MAX_TOKENS`] that admins alone make.
const MAX_OWN_TOKENS: usize = 64;
const ADMINS_TOKENS: usize = 64;

/// Sessions of one user; one more ends its oldest. So there are no more than so many times [`MAX_USERS`].
const MAX_OWN_SESSIONS: usize = 64;

/// Longest name that may be a user's, bytes.
const MAX_NAME_BYTES: usize = 64;

/// Passwords that are hashed at once: each takes 19 MiB and a processor for some tens of milliseconds.
const HASHED_AT_ONCE: usize = 2;

/// Who asks, and what they may.
#[derive(Clone, Debug)]
pub struct Caller {
    /// The user; none while there are no users.
    pub user: Option<String>,
    /// What the caller may do.
    pub grants: Arc<Grants>,
    /// What a page that logged in must send with every change, beside its cookie; none for others.
    pub csrf_token: Option<String>,
    /// Instant since which the account is as it is, with its role and password, and there is the token that the caller shows, by the
    /// machine's clock; of everybody, ever. A session takes the password, and counts as that.
    pub since: Timestamp,
}

impl Caller {
    /// Returns the user, unless it is an administrator: administrators have no bounds of their own.
    #[must_use]
    pub fn bounded_user(&self) -> Option<&str> {
        self.user.as_deref().filter(|_| self.grants.role() != Role::Admin)
    }
}

/// A page that logged in.
#[derive(Clone, Debug)]
pub struct LogIn {
    /// What its cookie holds.
    pub session: String,
    /// Who it is.
    pub caller: Caller,
}

/// User whose password was checked and was right.
#[derive(Debug)]
pub struct VerifiedUser {
    id: String,
    /// Digest that the password was checked against.
    password: Option<String>,
    caller: Caller,
}

impl VerifiedUser {
    /// Returns the user as a caller without a session.
    #[must_use]
    pub const fn caller(&self) -> &Caller {
        &self.caller
    }
}

#[derive(Debug)]
struct Session {
    user: String,
    csrf_token: String,
    /// Monotonic.
    until: Duration,
    /// Its place in the order of log-ins.
    number: u64,
}

/// What every request is looked up in.
#[derive(Debug, Default)]
struct Book {
    users: BTreeMap<String, User>,
    tokens: BTreeMap<String, TokenRecord>,
    /// By their keys' digests.
    sessions: HashMap<[u8; 32], Session>,
    /// Sessions that ever were.
    n_sessions_ever: u64,
}

impl Book {
    /// Adds a session. The user's oldest makes room for it, and nobody else's.
    fn add_session(&mut self, digest: [u8; 32], (user, csrf_token): (&str, String), now: Duration) {
        self.sessions.retain(|_, session| session.until > now);
        let own = || self.sessions.iter().filter(|(_, session)| session.user == user);
        let oldest = own().min_by_key(|(_, session)| session.number).map(|(digest, _)| *digest);
        if let Some(oldest) = oldest.filter(|_| own().count() >= MAX_OWN_SESSIONS) {
            self.sessions.remove(&oldest);
        }
        let (user, until) = (user.to_owned(), now.saturating_add(SESSION_TIME));
        self.n_sessions_ever += 1;
        let session = Session { user, csrf_token, until, number: self.n_sessions_ever };
        self.sessions.insert(digest, session);
    }
}

/// All users, tokens and sessions.
pub struct Accounts {
    store: Store,
    clock: Arc<dyn Clock>,
    book: RwLock<Book>,
    throttle: Mutex<Throttle>,
    /// One change after the other, so that what is checked still holds when it is written.
    changes: tokio::sync::Mutex<()>,
    hashing: Semaphore,
}

impl Accounts {
    /// The users and tokens that `store` keeps.
    ///
    /// # Errors
    /// When they cannot be read: then nobody is let in, rather than everybody.
    pub async fn open(store: Store, clock: Arc<dyn Clock>) -> Result<Self, AccountError> {
        let accounts = Self {
            store,
            clock,
            book: RwLock::default(),
            throttle: Mutex::default(),
            changes: tokio::sync::Mutex::default(),
            hashing: Semaphore::new(HASHED_AT_ONCE),
        };
        accounts.reload().await?;
        Ok(accounts)
    }

    /// Reads users and tokens again: another process may have changed them.
    ///
    /// # Errors
    /// When they cannot be read; what was known holds on.
    pub async fn reload(&self) -> Result<(), AccountError> {
        let _turn = self.changes.lock().await;
        let users = self.store.users().await?.into_iter();
        let users: Result<BTreeMap<_, _>, _> =
            users.map(|record| Ok::<_, AccountError>((record.id.clone(), User::read(record)?))).collect();
        let users = users?;
        let tokens = self.store.tokens().await?.into_iter().map(|token| (token.id.clone(), token)).collect();
        let mut book = self.write();
        if users.is_empty() && !book.users.is_empty() {
            // Without users everybody may do everything: that must not come of a database that was exchanged.
            return Err(AccountError::UsersGone);
        }
        let before = std::mem::replace(&mut book.users, users);
        book.tokens = tokens;
        let Book { users, sessions, .. } = &mut *book;
        let password =
            |of: &BTreeMap<String, User>, id: &str| of.get(id).and_then(|user| user.record.password.clone());
        // Who has another password now, or is gone, must log in again.
        sessions.retain(|_, of| {
            users.contains_key(&of.user) && password(&before, &of.user) == password(users, &of.user)
        });
        Ok(())
    }

    /// Whether there are no users, and everybody may do everything.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.read().users.is_empty()
    }

    /// Everybody, while there are no users.
    #[must_use]
    pub fn everybody() -> Caller {
        let since = Timestamp::from_nanos(i64::MIN);
        Caller { user: None, grants: Arc::new(Grants::everything()), csrf_token: None, since }
    }

    /// Whose token that is, if it is anybody's and has not expired.
    #[must_use]
    pub fn by_token(&self, text: &str) -> Option<Caller> {
        let (id, secret) = secret::parse_token(text)?;
        let book = self.read();
        let token = book.tokens.get(id).filter(|token| token.digest == secret::digest(secret))?;
        let is_over = token.expires_at.is_some_and(|at| at <= self.clock.now());
        let user = book.users.get(&token.user).filter(|_| !is_over)?;
        let caller = user.caller(None);
        Some(Caller { since: caller.since.max(token.created_at), ..caller })
    }

    /// Whose session that is, if it is anybody's and not over.
    #[must_use]
    pub fn by_session(&self, key: &str) -> Option<Caller> {
        let book = self.read();
        let session = book.sessions.get(&secret::digest(key))?;
        let is_over = session.until <= self.clock.monotonic();
        let user = book.users.get(&session.user).filter(|_| !is_over)?;
        Some(user.caller(Some(session.csrf_token.clone())))
    }

    /// Checks a password, without logging anybody in.
    ///
    /// # Errors
    /// [`AccountError::WrongPassword`], whether or not there is such a user; [`AccountError::Throttled`] after several of
    /// these; those of hashing.
    pub async fn check_password(
        &self,
        attempt: Attempt<'_>,
        password: &str,
    ) -> Result<VerifiedUser, AccountError> {
        let (now, id) = (self.clock.monotonic(), attempt.name);
        if id.len() > MAX_NAME_BYTES {
            // Nobody's, and nothing to remember.
            return Err(AccountError::WrongPassword);
        }
        if let Some(wait) = self.throttle().wait(attempt, now) {
            return Err(AccountError::Throttled { wait });
        }
        // Counted before it is tried, so that many tries at once gain nothing.
        let before = self.throttle().failed(attempt, now);
        let kept = self.read().users.get(id).and_then(|user| user.record.password.clone());
        let (given, tried) = (password.to_owned(), kept.clone());
        let is_right = self.hashed(move || secret::is_password(&given, tried.as_deref())).await?;
        let book = self.read();
        let user = book.users.get(id).filter(|user| is_right && user.record.password == kept);
        let caller = user.map(|user| user.caller(None)).ok_or(AccountError::WrongPassword)?;
        self.throttle().succeeded(attempt, before);
        Ok(VerifiedUser { id: id.to_owned(), password: kept, caller })
    }

    /// Begins a session of a user whose password was checked. The user's oldest session makes room for it.
    ///
    /// # Errors
    /// [`AccountError::WrongPassword`] if the password has changed since it was checked; [`AccountError::NoRandomness`].
    pub fn begin_session(&self, verified: VerifiedUser) -> Result<LogIn, AccountError> {
        let session = secret::secret()?;
        let csrf_token = secret::secret()?;
        let mut book = self.write();
        let user = book.users.get(&verified.id).filter(|user| user.record.password == verified.password);
        let caller = user.map(|user| user.caller(Some(csrf_token.clone())));
        let caller = caller.ok_or(AccountError::WrongPassword)?;
        book.add_session(secret::digest(&session), (&verified.id, csrf_token), self.clock.monotonic());
        Ok(LogIn { session, caller })
    }

    /// Ends a session; returns true where there was one.
    pub fn log_out(&self, key: &str) -> bool {
        self.write().sessions.remove(&secret::digest(key)).is_some()
    }

    /// All users, in the order of their names.
    #[must_use]
    pub fn users(&self) -> Vec<UserSummary> {
        self.read().users.values().map(User::summary).collect()
    }

    /// One user.
    ///
    /// # Errors
    /// [`AccountError::NoUser`].
    pub fn user(&self, id: &str) -> Result<UserSummary, AccountError> {
        self.read().users.get(id).map(User::summary).ok_or_else(|| AccountError::NoUser { id: id.to_owned() })
    }

    /// Makes a user, or changes the one of version `was`.
    ///
    /// # Errors
    /// [`AccountError::Faults`]; [`AccountError::Changed`] where the user is of another version, or there is one and `was` is
    /// none; [`AccountError::LastAdmin`] where nobody could change anything after it; the store's.
    pub async fn put_user(
        &self,
        id: &str,
        change: UserChange,
        was: Option<i64>,
    ) -> Result<UserSummary, AccountError> {
        let _turn = self.changes.lock().await;
        let known = self.read().users.get(id).map(|user| user.record.clone());
        if known.as_ref().map(|record| record.version) != was {
            return Err(AccountError::Changed { now: known.map(|record| record.version) });
        }
        let is_new = known.is_none();
        if is_new && self.read().users.len() >= MAX_USERS {
            return Err(AccountError::TooMany { what: "users", most: MAX_USERS });
        }
        let password = match change.password.clone() {
            Some(password) => Some(self.hashed(move || secret::hash_password(&password)).await??),
            None => known.as_ref().and_then(|record| record.password.clone()),
        };
        let now = self.clock.now();
        let record = UserRecord {
            id: id.to_owned(),
            role: change.role.as_str().to_owned(),
            rights: change.rights_text(),
            password,
            version: was.unwrap_or(0) + 1,
            created_at: known.map_or(now, |record| record.created_at),
            updated_at: now,
        };
        let user = User::read(record)?;
        self.check_admins(id, Some(&user))?;
        if !self.store.put_user(&user.record, was.unwrap_or(0)).await? {
            return Err(AccountError::Changed { now: None });
        }
        let summary = user.summary();
        let mut book = self.write();
        let before = book.users.insert(id.to_owned(), user);
        if before.is_some() && change.password.is_some() {
            book.sessions.retain(|_, session| session.user != id);
        }
        Ok(summary)
    }

    /// Removes the user of version `was`, with tokens and sessions.
    ///
    /// # Errors
    /// [`AccountError::NoUser`], [`AccountError::Changed`], [`AccountError::LastAdmin`]; the store's.
    pub async fn remove_user(&self, id: &str, was: i64) -> Result<(), AccountError> {
        let _turn = self.changes.lock().await;
        let now = self.user(id)?.version;
        if now != was {
            return Err(AccountError::Changed { now: Some(now) });
        }
        self.check_admins(id, None)?;
        if !self.store.delete_user(id, was).await? {
            return Err(AccountError::Changed { now: None });
        }
        let mut book = self.write();
        book.users.remove(id);
        book.tokens.retain(|_, token| token.user != id);
        book.sessions.retain(|_, session| session.user != id);
        Ok(())
    }

    /// The tokens of a user, or all, in the order of their ids.
    #[must_use]
    pub fn tokens(&self, user: Option<&str>) -> Vec<TokenSummary> {
        let is_asked = |token: &&TokenRecord| user.is_none_or(|user| token.user == user);
        self.read().tokens.values().filter(is_asked).map(TokenSummary::from).collect()
    }

    /// Makes a token, as admins do for anybody; what it is told by is in the answer, and nowhere else.
    ///
    /// # Errors
    /// [`AccountError::NoUser`], [`AccountError::TooMany`]; the store's.
    pub async fn add_token(
        &self,
        user: &str,
        note: String,
        expires_at: Option<Timestamp>,
    ) -> Result<(TokenSummary, String), AccountError> {
        let _turn = self.changes.lock().await;
        let most = MAX_TOKENS + ADMINS_TOKENS;
        if self.read().tokens.len() >= most {
            return Err(AccountError::TooMany { what: "tokens", most });
        }
        self.new_token(user, note, expires_at).await
    }

    /// Makes a token for a user who asks for it, as [`Self::add_token`] does, as many as one user may have.
    ///
    /// # Errors
    /// Errors of [`Self::add_token`]; [`AccountError::Quota`].
    pub async fn add_own_token(
        &self,
        user: &str,
        note: String,
        expires_at: Option<Timestamp>,
    ) -> Result<(TokenSummary, String), AccountError> {
        let _turn = self.changes.lock().await;
        {
            let book = self.read();
            let n_own = book.tokens.values().filter(|token| token.user == user).count();
            if n_own >= MAX_OWN_TOKENS {
                return Err(AccountError::Quota { what: "tokens", n_own });
            }
            if book.tokens.len() >= MAX_TOKENS {
                return Err(AccountError::TooMany { what: "tokens", most: MAX_TOKENS });
            }
        }
        self.new_token(user, note, expires_at).await
    }

    /// Makes a token, in this change's turn.
    async fn new_token(
        &self,
        user: &str,
        note: String,
        expires_at: Option<Timestamp>,
    ) -> Result<(TokenSummary, String), AccountError> {
        self.user(user)?;
        let (id, secret) = (secret::name()?, secret::secret()?);
        let record = TokenRecord {
            id: id.clone(),
            user: user.to_owned(),
            note,
            digest: secret::digest(&secret),
            created_at: self.clock.now(),
            expires_at,
        };
        self.store.add_token(&record).await?;
        let summary = TokenSummary::from(&record);
        self.write().tokens.insert(id.clone(), record);
        Ok((summary, secret::token(&id, &secret)))
    }

    /// Takes a token back, of `user` or of anybody: from the next request on it is nobody's.
    ///
    /// # Errors
    /// [`AccountError::NoToken`]; the store's.
    pub async fn remove_token(&self, id: &str, user: Option<&str>) -> Result<(), AccountError> {
        let _turn = self.changes.lock().await;
        let owner = self.read().tokens.get(id).map(|token| token.user.clone());
        if owner.is_none_or(|owner| user.is_some_and(|user| user != owner)) {
            return Err(AccountError::NoToken { id: id.to_owned() });
        }
        // First here: whatever the store meets, it is not taken any more by this process.
        let token = self.write().tokens.remove(id);
        let removed = self.store.delete_token(id).await;
        if let (Err(_), Some(token)) = (&removed, token) {
            self.write().tokens.insert(id.to_owned(), token);
        }
        removed.map(|_| ()).map_err(AccountError::from)
    }

    /// Whether somebody is left who can log in and change users, once `id` is `user`.
    fn check_admins(&self, id: &str, user: Option<&User>) -> Result<(), AccountError> {
        let book = self.read();
        let others = book.users.values().filter(|other| other.record.id != id);
        let can = |user: &User| user.role == Role::Admin && user.record.password.is_some();
        let mut all = others.chain(user);
        if all.any(can) { Ok(()) } else { Err(AccountError::LastAdmin) }
    }

    /// Runs what takes a processor for a while where it may, few at once.
    async fn hashed<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, AccountError> {
        let _permit = self.hashing.acquire().await.expect("the semaphore is never closed");
        tokio::task::spawn_blocking(work)
            .await
            .map_err(|panicked| AccountError::Internal(panicked.to_string()))
    }

    fn read(&self) -> RwLockReadGuard<'_, Book> {
        // Each change is of one map, whole before the lock is let go.
        self.book.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, Book> {
        self.book.write().unwrap_or_else(PoisonError::into_inner)
    }

    fn throttle(&self) -> MutexGuard<'_, Throttle> {
        self.throttle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl From<StoreError> for AccountError {
    fn from(error: StoreError) -> Self {
        Self::Store(Arc::new(error))
    }
}
