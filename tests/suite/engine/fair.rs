//! The renderer's time is shared fairly among users, and large pictures are drawn in pieces between which others are drawn.

use super::{Bench, FRAME_NANOS, SCENE, at, camera, has_adapter, named, pictures, request};
use glam::DVec3;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use tempfile::TempDir;
use tokio::task::JoinHandle;
use videofields_service::engine::{Flow, Handle, Origin, ViewRequest};
use videofields_testing::wait_for;
use videofields_vision::config::{End, Settings};

/// Large views that one user waits for at once.
const N_LARGE: u64 = 6;

fn yard(folder: &TempDir) -> Bench {
    let camera =
        ["north", "south"].map(|id| camera(id, pictures(folder.path(), id, 0..20), End::Stop)).to_vec();
    let mut settings = Settings { camera, ..Settings::default() };
    // Nothing is kept: whatever is asked for is drawn.
    settings.render.cache_mib = 0;
    settings.render.timeout_secs = 10.0;
    let bench = Bench::start(folder.path(), settings, &[("yard", SCENE)]);
    bench.wait_for_state("north", "ended");
    bench.wait_for_state("south", "ended");
    bench
}

/// A view from a place of its own.
fn seen_from(place: f64, (width_px, height_px): (u32, u32)) -> ViewRequest {
    let eye = Some(DVec3::new(7.0 + 1e-3 * place, -7.0, 5.0));
    ViewRequest {
        eye,
        width_px,
        height_px,
        effort: named(Some(4), None),
        ..request("yard", at(FRAME_NANOS * 10))
    }
}

/// Asks for a view of several pieces.
fn large(place: f64) -> ViewRequest {
    seen_from(place, (3000, 2000))
}

fn handle_of(bench: &Bench, user: &str) -> Handle {
    bench.handle.clone().in_turns_of(Flow::User(user.into()))
}

/// Asks for large views, one as soon as the one before is there.
fn loops(
    bench: &Bench,
    handle: &Handle,
    (n_done, is_over): (&Arc<AtomicU64>, &Arc<AtomicBool>),
) -> Vec<JoinHandle<()>> {
    let one = |idx: u64| {
        let (handle, n_done, is_over) = (handle.clone(), Arc::clone(n_done), Arc::clone(is_over));
        bench.runtime.spawn(async move {
            let mut place = idx as f64;
            while !is_over.load(Ordering::Relaxed) {
                place += N_LARGE as f64;
                // Those that take too long are refused.
                if handle.view(large(place)).await.is_ok() {
                    n_done.fetch_add(1, Ordering::Relaxed);
                }
            }
        })
    };
    (0..N_LARGE).map(one).collect()
}

fn n_turns(bench: &Bench) -> u64 {
    let text = bench.handle.metrics_text().unwrap();
    let line = text.lines().find(|line| line.starts_with("videofields_render_turn_seconds_count"));
    line.and_then(|line| line.rsplit_once(' ')).unwrap().1.parse().unwrap()
}

#[test]
fn a_users_small_views_wait_for_a_piece_of_anothers_large_ones_and_not_for_all_of_them() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let bench = yard(&folder);
    let (greedy, owner) = (handle_of(&bench, "greedy"), handle_of(&bench, "owner"));
    // Programs are made.
    bench.runtime.block_on(greedy.view(large(0.0))).unwrap();
    let (n_done, is_over) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicBool::new(false)));
    let loops = loops(&bench, &greedy, (&n_done, &is_over));
    wait_for("large views to be drawn", || (n_done.load(Ordering::Relaxed) > 0).then_some(()));
    for idx in 0..12 {
        let before = (n_done.load(Ordering::Relaxed), n_turns(&bench));
        let small = bench.runtime.block_on(owner.view(seen_from(f64::from(idx), (64, 48)))).unwrap();
        assert_eq!(small.origin, Origin::Drawn);
        let after = (n_done.load(Ordering::Relaxed), n_turns(&bench));
        // One is being drawn, and another turn may have begun before the small one was asked for.
        let (n_before, n_turns) = (after.0 - before.0, after.1 - before.1);
        assert!(n_before <= 2, "small view {idx} waited for {n_before} large ones");
        assert!(n_turns <= 3, "small view {idx} waited for {n_turns} turns");
    }
    // An interrupted picture is the same as an undisturbed one.
    let disturbed = bench.runtime.spawn({
        let greedy = greedy.clone();
        async move { greedy.view(large(-9.0)).await }
    });
    let mut place = 100.0;
    while !disturbed.is_finished() {
        place += 1.0;
        bench.runtime.block_on(owner.view(seen_from(place, (64, 48)))).unwrap();
    }
    is_over.store(true, Ordering::Relaxed);
    for one in loops {
        bench.runtime.block_on(one).unwrap();
    }
    if let Ok(disturbed) = bench.runtime.block_on(disturbed).unwrap() {
        assert!(disturbed.timings.iter().any(|(stage, _)| *stage == "pause"), "{:?}", disturbed.timings);
        let alone = bench.runtime.block_on(greedy.view(large(-9.0))).unwrap();
        assert!(alone.timings.iter().all(|(stage, _)| *stage != "pause"), "{:?}", alone.timings);
        assert!(alone.image == disturbed.image, "other bytes");
    }
    bench.stop();
}

/// Whoever leaves is drawn nothing: the next one's turn comes at once.
#[test]
fn a_large_view_whose_caller_left_is_drawn_no_further() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let bench = yard(&folder);
    let greedy = handle_of(&bench, "greedy");
    bench.runtime.block_on(greedy.view(large(0.0))).unwrap();
    let before = n_turns(&bench);
    let asked = bench.runtime.spawn({
        let greedy = greedy.clone();
        async move { greedy.view(large(1.0)).await }
    });
    wait_for("its first piece", || (n_turns(&bench) > before).then_some(()));
    asked.abort();
    wait_for("it to be let go", || {
        bench.handle.metrics_text().unwrap().contains("videofields_render_abandoned_total 1").then_some(())
    });
    bench.runtime.block_on(greedy.view(seen_from(0.0, (64, 48)))).unwrap();
    bench.stop();
}
