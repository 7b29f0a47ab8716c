//! `user` and `token`: who may ask a daemon for what, changed in its database.

use super::operator;
use anyhow::{Context, Result, bail};
use std::collections::BTreeMap;
use std::io::BufRead as _;
use std::path::PathBuf;
use std::sync::Arc;
use videofields_recording::accounts::{Accounts, UserChange};
use videofields_recording::store::Store;
use videofields_recording::telemetry::{self, LogFormat};
use videofields_vision::access::{Right, Rights, Role};
use videofields_vision::clock::{Clock, SystemClock, Timestamp};
use videofields_vision::config;
use videofields_vision::frame::is_id;

/// Lists, makes, changes and removes the users of a daemon.
///
/// Works on the daemon's database, whether it runs or not; a running daemon knows of it within half a minute. While there is
/// no user everybody may do everything, so the first must be an admin with a password.
#[derive(Debug, clap::Args)]
pub(crate) struct User {
    /// The daemon's configuration (TOML).
    file: PathBuf,
    #[command(subcommand)]
    action: UserAction,
}

#[derive(Debug, clap::Subcommand)]
enum UserAction {
    /// Shows every user with role and rights.
    List,
    /// Makes a user, or changes the one of that name: role and rights become what is given.
    Set {
        /// 1 to 64 of a-z, 0-9, - and _, the first a letter or digit.
        name: String,
        /// What the user may do beside seeing.
        #[arg(long, value_parser = role)]
        role: Role,
        /// Rights of one camera or, as `*`, of all: `north=live,history`. Again for each camera.
        #[arg(long = "camera", value_name = "CAMERA=RIGHTS", value_parser = rights)]
        cameras: Vec<(String, Rights)>,
        /// Takes a new password (12 to 256 characters) from the first line of standard input.
        #[arg(long)]
        password: bool,
    },
    /// Removes a user with all tokens.
    Remove {
        /// Its name.
        name: String,
    },
}

/// Lists, makes and revokes tokens, which programs show in a user's place.
///
/// Works on the daemon's database, whether it runs or not; a running daemon knows of it within half a minute.
#[derive(Debug, clap::Args)]
pub(crate) struct Token {
    /// The daemon's configuration (TOML).
    file: PathBuf,
    #[command(subcommand)]
    action: TokenAction,
}

#[derive(Debug, clap::Subcommand)]
enum TokenAction {
    /// Shows every token without its secret.
    List,
    /// Makes a token and writes it to standard output: it is shown this once.
    Add {
        /// Whose it is to be.
        user: String,
        /// What it is for.
        #[arg(long, default_value = "")]
        note: String,
        /// From when on it is not taken any more (RFC 3339).
        #[arg(long)]
        expires_at: Option<Timestamp>,
    },
    /// Takes a token back.
    Revoke {
        /// Its public part: what stands between `vf_` and the next `_`.
        id: String,
    },
}

fn role(text: &str) -> Result<Role, String> {
    let found = Role::ALL.into_iter().find(|role| role.as_str() == text);
    found.ok_or_else(|| format!("expected {}", Role::ALL.map(Role::as_str).join(", ")))
}

fn rights(text: &str) -> Result<(String, Rights), String> {
    let (camera, names) = text.split_once('=').ok_or("expected a camera's id or *, then = and rights")?;
    let right = |name: &str| {
        let found = Right::ALL.into_iter().find(|right| right.as_str() == name);
        found.ok_or_else(|| format!("{name:?} is no right: {}", Right::ALL.map(Right::as_str).join(", ")))
    };
    let rights = names.split(',').map(right).collect::<Result<Vec<_>, _>>()?;
    Ok((camera.to_owned(), Rights::from(rights)))
}

impl User {
    pub(crate) fn run(&self) -> Result<()> {
        with_accounts(&self.file, async |accounts, _clock| match &self.action {
            UserAction::List => list_users(accounts).map(|()| None),
            UserAction::Set { name, role, cameras, password } => {
                if !is_id(name) {
                    bail!("{name:?} is no name: 1 to 64 of a-z, 0-9, - and _, the first a letter or digit");
                }
                let password = if *password { Some(first_line()?) } else { None };
                let cameras: BTreeMap<_, _> = cameras.iter().cloned().collect();
                let change = UserChange { role: *role, cameras, password };
                change.check()?;
                let was = accounts.user(name).ok().map(|user| user.version);
                accounts.put_user(name, change, was).await?;
                Ok(Some(("user set", name.clone())))
            }
            UserAction::Remove { name } => {
                let version = accounts.user(name)?.version;
                accounts.remove_user(name, version).await?;
                Ok(Some(("user remove", name.clone())))
            }
        })
    }
}

impl Token {
    pub(crate) fn run(&self) -> Result<()> {
        with_accounts(&self.file, async |accounts, clock| match &self.action {
            TokenAction::List => list_tokens(accounts).map(|()| None),
            TokenAction::Add { user, note, expires_at } => {
                if expires_at.is_some_and(|at| at <= clock.now()) {
                    bail!("--expires-at lies in the past");
                }
                let (made, token) = accounts.add_token(user, note.clone(), *expires_at).await?;
                super::say(&token)?;
                Ok(Some(("token add", format!("{user} {}", made.id))))
            }
            TokenAction::Revoke { id } => {
                accounts.remove_token(id, None).await?;
                Ok(Some(("token revoke", id.clone())))
            }
        })
    }
}

fn list_users(accounts: &Accounts) -> Result<()> {
    for user in accounts.users() {
        let of = |(camera, rights): (&String, &Rights)| {
            let names: Vec<&str> = Vec::<Right>::from(*rights).into_iter().map(Right::as_str).collect();
            format!("{camera}={}", names.join(","))
        };
        let rights: Vec<String> = user.cameras.iter().map(of).collect();
        let password = if user.has_password { "password" } else { "tokens alone" };
        super::say(&format!("{}\t{}\t{}\t{password}", user.id, user.role.as_str(), rights.join(" ")))?;
    }
    Ok(())
}

fn list_tokens(accounts: &Accounts) -> Result<()> {
    for token in accounts.tokens(None) {
        let expires = token.expires_at.unwrap_or_else(|| "never".to_owned());
        // A note is its maker's: it must not pass for columns or move the terminal's cursor.
        let note = token.note.escape_debug();
        super::say(&format!(
            "{}\t{}\tmade {}\texpires {expires}\t{note}",
            token.id, token.user, token.created_at
        ))?;
    }
    Ok(())
}

/// The first line of standard input without its end.
fn first_line() -> Result<String> {
    let mut line = String::new();
    std::io::stdin().lock().read_line(&mut line).context("cannot read the password from standard input")?;
    Ok(line.trim_end_matches(['\r', '\n']).to_owned())
}

/// What was done and to what, for the audit log; nothing where it was only looked.
type Done = Option<(&'static str, String)>;

/// Opens the daemon's database and closes it after `work`; what that has done is noted in the audit log.
fn with_accounts(
    file: &std::path::Path,
    work: impl AsyncFnOnce(&Accounts, &dyn Clock) -> Result<Done>,
) -> Result<()> {
    telemetry::init(LogFormat::Text, Some("warn"))?;
    let config = config::load(file)?;
    let runtime = tokio::runtime::Runtime::new().context("cannot start the I/O threads")?;
    runtime.block_on(async {
        let store = Store::open(&config.settings().storage.database).await?;
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
        let done = match Accounts::open(store.clone(), Arc::clone(&clock)).await {
            Ok(accounts) => work(&accounts, &*clock).await,
            Err(error) => Err(error.into()),
        };
        let noted = match &done {
            Ok(Some((action, target))) => {
                let key = operator::audit_key(&config);
                let entry = operator::entry(action, target.clone());
                let signer = operator::signer(&config, key.as_ref());
                store.note_audit(&entry, signer).await.map(|_number| ())
            }
            Ok(None) | Err(_) => Ok(()),
        };
        store.close().await?;
        done?;
        noted.context("it is done, but not noted in the audit log")
    })
}
