//! Who asks: from a request's token or cookie to a caller, and to the door that is theirs.
//!
//! `identify` looks every request up before any route sees it; `require` stands before all routes but those that anybody
//! may ask. A route takes [`Asked`], whose door shows what the caller may see and nothing else.

use super::Api;
use super::address;
use super::connection::Connection;
use super::error::Problem;
use axum::extract::{FromRequestParts, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::sync::Arc;
use videofields_recording::accounts::{Accounts, Caller};
use videofields_service::catalog::Changer;
use videofields_service::engine::{Flow, Handle};
use videofields_vision::access::{Grants, Role};
use videofields_vision::error::ErrorKind;

/// The cookie of a page that logged in.
pub(super) const COOKIE: &str = "videofields_session";

/// The cookie of a screen that was given a token.
pub(super) const SCREEN_COOKIE: &str = "videofields_screen";

/// The field in which a page that logged in proves that a change is its own.
pub(super) const CSRF_FIELD: &str = "x-csrf-token";

/// Of a token that lets nobody in.
pub(super) const NOBODYS_TOKEN: &str = "the token is nobody's: revoked, expired or mistyped";

/// What a caller showed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Credential {
    Token(String),
    Session(String),
    /// A token that a browser keeps, as that of a wall's screen: with it nothing can be changed.
    Screen(String),
}

/// Who asks, and by what.
#[derive(Clone, Debug)]
pub(super) struct Identity {
    pub(super) caller: Caller,
    pub(super) credential: Option<Credential>,
}

impl Identity {
    /// While there are no users.
    pub(super) fn everybody() -> Self {
        Self { caller: Accounts::everybody(), credential: None }
    }

    /// Whoever shows nothing where there are users.
    fn stranger() -> Self {
        let caller = Caller { grants: Arc::new(Grants::nothing()), ..Accounts::everybody() };
        Self { caller, credential: None }
    }

    /// Returns true for who is neither a user nor, while there are no users, everybody.
    pub(super) fn is_stranger(&self) -> bool {
        self.caller.user.is_none() && !self.caller.grants.is_everything()
    }

    /// Whose screen a token makes a browser; none if the token is nobody's.
    pub(super) fn screen(accounts: &Accounts, token: String) -> Option<Self> {
        Self::of(accounts, Credential::Screen(token))
    }

    /// Who that is now; none once the token or session is nobody's any more.
    fn of(accounts: &Accounts, credential: Credential) -> Option<Self> {
        let caller = match &credential {
            Credential::Token(token) | Credential::Screen(token) => accounts.by_token(token),
            Credential::Session(key) => accounts.by_session(key),
        }?;
        Some(Self { caller, credential: Some(credential) })
    }
}

/// What a request shows: a token, or else what its browser keeps, the session before a screen's token.
fn credentials(headers: &HeaderMap) -> Vec<Credential> {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    if let Some((scheme, token)) = text(header::AUTHORIZATION).and_then(|value| value.split_once(' '))
        && scheme.eq_ignore_ascii_case("bearer")
    {
        return vec![Credential::Token(token.trim().to_owned())];
    }
    let cookies = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
    let pairs = cookies.flat_map(|all| all.split(';')).filter_map(|pair| pair.trim().split_once('='));
    let (mut session, mut screen) = (None, None);
    for (name, value) in pairs {
        match name {
            COOKIE if session.is_none() => session = Some(Credential::Session(value.to_owned())),
            SCREEN_COOKIE if screen.is_none() => screen = Some(Credential::Screen(value.to_owned())),
            _ => {}
        }
    }
    session.into_iter().chain(screen).collect()
}

/// Looks up who asks. A token that is nobody's is refused at once; an old cookie counts as none.
pub(super) async fn identify(State(api): State<Api>, mut request: Request, next: Next) -> Response {
    let identity = match &api.accounts {
        Some(accounts) if !accounts.is_open() => {
            let shown = credentials(request.headers());
            let known = shown.iter().find_map(|credential| Identity::of(accounts, credential.clone()));
            if let (None, Some(Credential::Token(_))) = (&known, shown.first()) {
                return Problem::new(ErrorKind::Unauthenticated, NOBODYS_TOKEN).into_response();
            }
            known.unwrap_or_else(Identity::stranger)
        }
        _ => Identity::everybody(),
    };
    request.extensions_mut().insert(identity);
    next.run(request).await
}

/// Refuses strangers, and changes that a page asks for without proof that they are its own.
pub(super) async fn require(request: Request, next: Next) -> Response {
    let Some(identity) = request.extensions().get::<Identity>() else {
        return Problem::new(ErrorKind::Internal, "nobody looked up who asks").into_response();
    };
    if identity.is_stranger() {
        let detail = "log in (POST /api/v1/session), or send a token: Authorization: Bearer vf_...";
        return Problem::new(ErrorKind::Unauthenticated, detail).into_response();
    }
    let is_safe = matches!(*request.method(), Method::GET | Method::HEAD | Method::OPTIONS);
    if !is_safe && matches!(identity.credential, Some(Credential::Screen(_))) {
        let detail =
            "a screen's token may look and change nothing: log in, or send the token as Authorization";
        return Problem::new(ErrorKind::Forbidden, detail).into_response();
    }
    let proof = request.headers().get(CSRF_FIELD).and_then(|value| value.to_str().ok());
    if !is_safe && identity.caller.csrf_token.as_deref().is_some_and(|token| proof != Some(token)) {
        let detail = format!("with a session, a change needs {CSRF_FIELD}: what GET /api/v1/session tells");
        return Problem::new(ErrorKind::Forbidden, detail).into_response();
    }
    next.run(request).await
}

/// The interface as the caller may use it.
pub(super) struct Asked(pub(super) Api);

impl FromRequestParts<Api> for Asked {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, api: &Api) -> Result<Self, Problem> {
        let identity = parts.extensions.get::<Identity>();
        let identity =
            identity.ok_or_else(|| Problem::new(ErrorKind::Internal, "nobody looked up who asks"))?;
        let connection = parts.extensions.get::<Connection>().cloned().unwrap_or_default();
        let mut asked = api.of(identity.clone());
        if identity.caller.user.is_none() {
            let from = address::of(connection.peer(), &parts.headers, &api.site.trusted_proxies);
            // All programs of this machine have one.
            let from = from.filter(|from| !from.is_loopback()).map(address::network_of);
            asked.door = asked.door.in_turns_of(from.map_or(Flow::Common, Flow::Address));
        }
        Ok(Self(Api { connection, ..asked }))
    }
}

impl Api {
    fn of(&self, identity: Identity) -> Self {
        let user = identity.caller.user.as_deref();
        let flow = user.map_or(Flow::Common, |user| Flow::User(user.into()));
        let door = Handle::within(&self.whole, Arc::clone(&identity.caller.grants)).in_turns_of(flow);
        Self { door, identity, ..self.clone() }
    }

    /// The same as the caller may use it by now; none once the caller is nobody any more. What goes on for long asks this
    /// again and again.
    pub(super) fn renewed(&self) -> Option<Self> {
        let Some(accounts) = &self.accounts else { return Some(self.clone()) };
        match &self.identity.credential {
            Some(credential) => Identity::of(accounts, credential.clone()).map(|identity| self.of(identity)),
            None => accounts.is_open().then(|| self.clone()),
        }
    }

    /// Refuses who is no admin.
    pub(super) fn check_admin(&self, what: &str) -> Result<(), Problem> {
        if self.identity.caller.grants.role() == Role::Admin {
            return Ok(());
        }
        Err(Problem::new(ErrorKind::Forbidden, format!("{what} is for admins")))
    }

    /// Returns the caller as who changes what is kept.
    pub(super) fn changer(&self) -> Changer {
        let caller = &self.identity.caller;
        Changer { user: caller.user.clone(), role: caller.grants.role() }
    }

    /// Refuses who is neither operator nor admin.
    pub(super) fn check_operator(&self, what: &str) -> Result<(), Problem> {
        if self.identity.caller.grants.role() >= Role::Operator {
            return Ok(());
        }
        Err(Problem::new(ErrorKind::Forbidden, format!("{what} is for operators and admins")))
    }

    /// The users; of a daemon that keeps none, that it does not.
    pub(super) fn accounts(&self) -> Result<&Accounts, Problem> {
        let accounts = self.accounts.as_deref();
        accounts.ok_or_else(|| Problem::new(ErrorKind::Unsupported, "this daemon keeps no users"))
    }
}
