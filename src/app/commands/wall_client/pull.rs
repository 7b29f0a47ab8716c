//! Tiles that are asked for one by one: of all the same frame, again and again.

use super::frames::{Arrival, Tally};
use super::site::{Connection, Site, refusal};
use anyhow::{Context, Result, bail};
use hyper::{HeaderMap, StatusCode};
use std::time::Duration;
use videofields_vision::clock::Clock;

/// Times in a row that nothing came of any tile, after which it is given up.
const MAX_FAILURES: u32 = 20;

/// What came of one question.
struct Answer {
    status: StatusCode,
    headers: HeaderMap,
    body: axum::body::Bytes,
    at: Duration,
    took: Duration,
}

pub(super) async fn measure(
    site: &Site,
    (wall, tiles): (&str, &[String]),
    time: Duration,
    clock: &dyn Clock,
) -> Result<Tally> {
    let mut tally = Tally::new(tiles, "pull");
    let mut connections = Vec::new();
    for _ in tiles {
        connections.push(site.open().await?);
    }
    let begun = clock.monotonic();
    let (mut at, mut n_failures) = (None, 0);
    while clock.monotonic().saturating_sub(begun) < time {
        let path = |tile: &String| match at {
            Some(at) => format!("/api/v1/walls/{wall}/tiles/{tile}/frame.jpg?at={at}"),
            None => format!("/api/v1/walls/{wall}/tiles/{tile}/frame.jpg"),
        };
        let asked = connections.iter_mut().zip(tiles).map(|(own, tile)| ask(site, own, path(tile), clock));
        let answers = futures_util::future::join_all(asked).await;
        let mut newest = None;
        for (tile, answer) in answers.into_iter().enumerate() {
            let answer = answer?;
            if answer.status != StatusCode::OK {
                if answer.status.is_client_error() {
                    bail!("tile {}: {}", tiles[tile], refusal(answer.status, &answer.body));
                }
                tally.n_failed += 1;
                continue;
            }
            let arrival = arrival(tile, &answer)?;
            tally.n_moved_on += u64::from(at.is_some_and(|at| at != arrival.frame));
            newest = newest.max(Some(arrival.frame));
            tally.take(arrival);
        }
        n_failures = if newest.is_some() { 0 } else { n_failures + 1 };
        if n_failures > MAX_FAILURES {
            bail!("nothing came of any tile {MAX_FAILURES} times in a row");
        }
        if newest.is_none() {
            tokio::time::sleep(Duration::from_millis(500)).await;
        }
        at = newest.map(|newest| newest + 1).or(at);
    }
    tally.end(clock.monotonic().saturating_sub(begun));
    Ok(tally)
}

/// Asks, on another connection where the one at hand is over.
async fn ask(site: &Site, own: &mut Connection, path: String, clock: &dyn Clock) -> Result<Answer> {
    let asked = clock.monotonic();
    let answer = match own.get(site, &path).await {
        Ok(answer) => answer,
        Err(_over) => {
            *own = site.open().await?;
            own.get(site, &path).await?
        }
    };
    let (status, headers, body) = answer;
    let at = clock.monotonic();
    Ok(Answer { status, headers, body, at, took: at.saturating_sub(asked) })
}

fn arrival(tile: usize, answer: &Answer) -> Result<Arrival> {
    let field = |name: &str| {
        let value = answer.headers.get(name).and_then(|value| value.to_str().ok());
        value.with_context(|| format!("the answer lacks {name}"))
    };
    Ok(Arrival {
        tile,
        version: field("videofields-wall-version")?.parse()?,
        frame: field("videofields-wall-frame")?.parse()?,
        instant: field("videofields-time")?.to_owned(),
        at: answer.at,
        took: answer.took,
        n_bytes: answer.body.len(),
    })
}
