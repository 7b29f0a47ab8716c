//! Keeps every scene camera's texture-to-world map, whenever scenes change: from the store where its digest is still
//! right, built anew where it is not.

use super::EngineError;
use super::shared::{MapState, Shared};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use tokio::runtime::Handle as Runtime;
use videofields_picture::scene::{Scene, SceneCamera};
use videofields_recording::ingest::StopFlag;
use videofields_recording::store::{Store, StoreError, TextureMapRecord};
use videofields_vision::error::{ErrorKind, Fault};
use videofields_vision::frame::CameraId;
use videofields_vision::mapping::{Builder, MappingError, WorldMap, digest};

/// How a camera's texture-to-world map of a scene stands.
#[derive(Clone, Debug)]
pub struct MapSummary {
    /// The scene's id.
    pub scene: String,
    /// The camera.
    pub camera: CameraId,
    /// How far it is.
    pub progress: MapProgress,
}

/// How far a map is.
#[derive(Clone, Debug)]
pub enum MapProgress {
    /// It is being built, or waits for others.
    Building,
    /// It is there.
    Ready,
    /// It came to nothing, and why.
    Failed(EngineError),
}

impl Shared {
    /// How the maps of the cameras of these scenes stand.
    pub(super) fn map_summaries(&self, scenes: &[Arc<Scene>]) -> Vec<MapSummary> {
        let members = scenes.iter().flat_map(|scene| scene.cameras.iter().map(move |of| (scene, &of.id)));
        members
            .map(|(scene, camera)| MapSummary {
                scene: scene.id.clone(),
                camera: camera.clone(),
                progress: match self.map_state(&scene.id, camera) {
                    None | Some(MapState::Building) => MapProgress::Building,
                    Some(MapState::Ready(_)) => MapProgress::Ready,
                    Some(MapState::Failed(error)) => MapProgress::Failed(error),
                },
            })
            .collect()
    }
}

/// How maps are made: exactly. The grid is the cheap form, measured against this one.
const BUILDER: Builder = Builder::Ray;

/// Brings every map in, one after the other, and those of scenes that change; ends after the one in hand once `stop` is raised.
pub(super) fn run(shared: &Shared, store: &Store, runtime: &Runtime, stop: &StopFlag) {
    // Cores of their own: in the pool that the cameras share, a map's many pieces would go before every frame.
    let n_threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get).div_ceil(2);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads);
    let pool = match pool.thread_name(|idx| format!("map-{idx}")).build() {
        Ok(pool) => pool,
        Err(error) => {
            let failure = EngineError::Internal(format!("cannot start the threads that build maps: {error}"));
            tracing::error!(error = %failure, "no texture-to-world maps");
            for scene in &*shared.scenes.all() {
                for member in &scene.cameras {
                    shared.set_map(scene, &member.id, MapState::Failed(failure.clone()));
                }
            }
            return;
        }
    };
    while !stop.is_raised() {
        let listed = shared.scenes.now();
        for scene in &*listed.scenes {
            bring_in(shared, (store, runtime, &pool), scene, stop);
        }
        shared.scenes.wait_for_change(listed.changes);
    }
}

/// Brings in what a scene has not yet of maps.
fn bring_in(
    shared: &Shared,
    (store, runtime, pool): (&Store, &Runtime, &rayon::ThreadPool),
    scene: &Arc<Scene>,
    stop: &StopFlag,
) {
    for member in &scene.cameras {
        if stop.is_raised() || !shared.scenes.is_current(scene) {
            return;
        }
        if !shared.needs_map(scene, &member.id) {
            continue;
        }
        // One map that meets a fault leaves the others to be built. A panic leaves nothing half-changed: the
        // map in hand is dropped, and the store's own transactions are whole or not there.
        let build = AssertUnwindSafe(|| map(shared, store, runtime, pool, scene, member));
        let built = catch_unwind(build).unwrap_or_else(|_panic| {
            Err(EngineError::Internal(format!("building the map of camera {} panicked", member.id)))
        });
        let state = match built {
            Ok(map) => MapState::Ready(Arc::new(map)),
            Err(error) => {
                tracing::error!(scene = scene.id, camera = %member.id, %error, "no texture-to-world map");
                MapState::Failed(error)
            }
        };
        shared.set_map(scene, &member.id, state);
    }
}

fn map(
    shared: &Shared,
    store: &Store,
    runtime: &Runtime,
    pool: &rayon::ThreadPool,
    scene: &Scene,
    member: &SceneCamera,
) -> Result<WorldMap, EngineError> {
    let size_px = member.camera.size_px();
    let digest = digest(&member.camera, &scene.surfaces, BUILDER, size_px);
    if let Some(stored) = stored(store, runtime, &digest, &member.id) {
        return Ok(stored);
    }
    let started = shared.clock.monotonic();
    let build = || BUILDER.build(&member.camera, &scene.surfaces, size_px);
    let map = pool.install(build).map_err(|error| failure_of(&error))?;
    let took = shared.clock.monotonic().saturating_sub(started);
    tracing::info!(scene = scene.id, camera = %member.id, ?took, "texture-to-world map built");
    let record = TextureMapRecord {
        digest,
        scene: scene.id.clone(),
        camera: member.id.clone(),
        created_at: shared.clock.now(),
        bytes: map.encode().map_err(|error| failure_of(&error))?,
    };
    // A map that cannot be kept is still a map; it is built again at the next start.
    if let Err(error) = runtime.block_on(keep(store, &record)) {
        tracing::warn!(scene = scene.id, camera = %member.id, %error, "texture-to-world map not kept");
    }
    Ok(map)
}

/// The map of that digest, if the store has it whole.
fn stored(store: &Store, runtime: &Runtime, digest: &[u8; 32], camera: &CameraId) -> Option<WorldMap> {
    let record = match runtime.block_on(store.texture_map(digest)) {
        Ok(record) => record?,
        Err(error) => {
            tracing::warn!(%camera, %error, "stored texture-to-world map not read");
            return None;
        }
    };
    match WorldMap::decode(&record.bytes) {
        Ok(map) => Some(map),
        Err(error) => {
            tracing::warn!(%camera, %error, "stored texture-to-world map damaged, building it anew");
            None
        }
    }
}

async fn keep(store: &Store, record: &TextureMapRecord) -> Result<(), StoreError> {
    store.put_texture_map(record).await?;
    store.delete_stale_texture_maps(&record.scene, &record.camera, &record.digest).await?;
    Ok(())
}

/// A map's failure as the engine's; a calibration of too many texels is the scene's fault and not the daemon's.
fn failure_of(error: &MappingError) -> EngineError {
    match error.kind() {
        ErrorKind::TooLarge => EngineError::TooLarge(Fault::new("method", error.to_string())),
        _ => EngineError::Internal(error.to_string()),
    }
}
