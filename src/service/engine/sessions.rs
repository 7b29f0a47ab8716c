//! View sessions by name: what is smoothed over scene time for each who looks.

use videofields_picture::plan::ViewSession;
use videofields_picture::scene::Scene;
use videofields_vision::frame::CameraId;

/// Most sessions that are kept; the one used longest ago goes first, and begins anew when it is named again.
const MAX_SESSIONS: usize = 64;

/// The sessions, the one used last first. Each takes some hundred bytes.
#[derive(Debug, Default)]
pub(super) struct Sessions {
    kept: Vec<Kept>,
}

#[derive(Debug)]
struct Kept {
    /// A changed scene goes on with its sessions; one with other cameras has its own. No scene is held for them.
    scene: String,
    cameras: Vec<CameraId>,
    name: String,
    session: ViewSession,
}

impl Sessions {
    /// Takes the session of that name out, to be put back when it has gone on; a new one where there is none.
    pub(super) fn take(&mut self, scene: &Scene, name: &str) -> ViewSession {
        let place = self.kept.iter().position(|kept| {
            let cameras = scene.cameras.iter().map(|member| &member.id);
            kept.scene == scene.id && kept.name == name && cameras.eq(&kept.cameras)
        });
        place.map_or_else(ViewSession::default, |idx| self.kept.remove(idx).session)
    }

    pub(super) fn put(&mut self, scene: &Scene, name: &str, session: ViewSession) {
        self.kept.truncate(MAX_SESSIONS - 1);
        let cameras = scene.cameras.iter().map(|member| member.id.clone()).collect();
        self.kept.insert(0, Kept { scene: scene.id.clone(), cameras, name: name.to_owned(), session });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sessions_used_last_are_kept() {
        let mut sessions = Sessions::default();
        let plaza = videofields_picture::scene::parse(
            "plaza",
            r#"{"version": 1}"#,
            videofields_picture::scene::no_imports,
        )
        .unwrap();
        let plaza = &plaza.scene;
        for idx in 0..MAX_SESSIONS + 5 {
            let session = sessions.take(plaza, &format!("wall{idx}"));
            sessions.put(plaza, &format!("wall{idx}"), session);
            let session = sessions.take(plaza, "operator");
            sessions.put(plaza, "operator", session);
        }
        assert_eq!(sessions.kept.len(), MAX_SESSIONS);
        assert!(sessions.kept.iter().any(|kept| kept.name == "operator"));
        assert!(!sessions.kept.iter().any(|kept| kept.name == "wall0"));
        sessions.take(plaza, "operator");
        assert!(!sessions.kept.iter().any(|kept| kept.name == "operator"), "taken out");
    }
}
