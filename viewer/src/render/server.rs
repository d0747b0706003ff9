//! Pictures on demand for a program that draws with ours: one scene at a time stays uploaded and compiled, so that
//! another camera or another light costs no more than its frames.

use crate::error::ViewerError;
use crate::options::RenderMode;
use crate::render::bricks::load_bricks;
use crate::render::control::Control;
use crate::render::headless::{RenderParams, Rendered, Session};
use crate::scene::file::{SceneView, load_scene};
use crate::scene::material::Shown;
use crate::scene::scene::Scene;
use btf_runtime::PackedGoal;
use serde::Deserialize;
use std::path::PathBuf;
use std::sync::Arc;

/// A picture that is asked for.
#[derive(Deserialize, Clone)]
#[serde(deny_unknown_fields)]
pub struct PictureRequest {
    /// The scene file: meshes, materials, environment. It is read again when its text has changed, so the files that it
    /// names get new names when they change.
    pub scene: PathBuf,
    /// Camera and lights; without them those of the scene file.
    pub view: Option<SceneView>,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Frames to average, at least 1.
    pub frames: u32,
    /// Which light is followed; without it that of the command line.
    pub mode: Option<RenderMode>,
    /// Rays of a path at most; without it that of the command line.
    pub depth: Option<u32>,
}

/// The scene at hand.
struct Loaded {
    /// Path and text of its file.
    file: (PathBuf, String),
    /// As the file has it.
    scene: Scene,
    /// The scene as it is uploaded; `None` before its first picture.
    session: Option<Session>,
}

/// Renders pictures on demand.
pub struct PictureServer {
    /// What requests leave out, and the renderer.
    usual: RenderParams,
    /// How assets are packed, if they are.
    packing: Option<PackedGoal>,
    loaded: Option<Loaded>,
}

impl PictureServer {
    /// Makes a server without a scene; `usual` names the renderer and has what requests leave out. Assets are held with
    /// packed bases where `packing` says how.
    pub fn new(usual: RenderParams, packing: Option<PackedGoal>) -> PictureServer {
        PictureServer { usual, packing, loaded: None }
    }

    /// Renders a picture. Cost: that of its frames, and with another scene than before that of reading, uploading and
    /// compiling it.
    ///
    /// # Errors
    /// Those of [`load_scene`], [`SceneView::put_into`] and [`render`](crate::render()).
    pub fn draw(&mut self, request: &PictureRequest, control: &Control) -> Result<Rendered, ViewerError> {
        let mut params = RenderParams { size: request.size, frames: request.frames, ..self.usual.clone() };
        params.shade.mode = request.mode.unwrap_or(params.shade.mode);
        params.shade.depth = request.depth.unwrap_or(params.shade.depth);
        params.check()?;
        let read = |source| ViewerError::Read { path: request.scene.clone(), source };
        let file = (request.scene.clone(), btf_capture::files::read_to_string(&request.scene).map_err(read)?);
        if self.loaded.as_ref().is_none_or(|loaded| loaded.file != file) {
            // The old scene gives its memory back first.
            self.loaded = None;
            let mut scene = load_scene(&request.scene, Shown::default())?;
            if let Some(goal) = self.packing {
                scene.assets.iter_mut().for_each(|asset| *asset = Arc::new(asset.packed(goal)));
            }
            self.loaded = Some(Loaded { file, scene, session: None });
        }
        let Some(loaded) = &mut self.loaded else { return Err(ViewerError::Interrupted) };
        let mut scene = loaded.scene.clone();
        if let Some(view) = &request.view {
            view.put_into(&mut scene, &request.scene)?;
        }
        let (frames, budget_mb) = (params.frames, params.volume_budget_mb);
        let (bricks, other) = load_bricks(&mut loaded.scene, &[scene.camera], params.size, frames, budget_mb, control)?;
        if other {
            // What was uploaded gives its memory back first.
            loaded.session = None;
        }
        let session = match &mut loaded.session {
            Some(session) => session,
            none => none.insert(Session::new(&loaded.scene, &params, control)?),
        };
        scene.volumes.clone_from(&loaded.scene.volumes);
        let mut drawn = session.render(&scene, &params, control);
        drawn.iter_mut().for_each(|drawn| drawn.report.volume_bricks = bricks);
        if drawn.is_err() {
            // A device that is lost draws nothing more: the next request opens it anew.
            self.loaded = None;
        }
        drawn
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::backend::BackendChoice;
    use crate::options::ShadeOptions;
    use crate::render::headless::render;

    const SCENE: &str = "[[material]]\nname = \"grey\"\ndiffuse = [0.5, 0.4, 0.3]\n\
                         [[object]]\nmesh = \"sphere\"\nmaterial = \"grey\"\n";

    fn usual() -> RenderParams {
        let (backend, shade) = (BackendChoice::Cpu, ShadeOptions::default());
        RenderParams { size: [1, 1], backend, shade, ..RenderParams::default() }
    }

    fn request(scene: &std::path::Path, more: &str) -> PictureRequest {
        let text = format!("{{\"scene\": {:?}, \"size\": [24, 16], \"frames\": 1{more}}}", scene.display());
        serde_json::from_str(&text).unwrap()
    }

    fn drawn(server: &mut PictureServer, request: &PictureRequest) -> Vec<[f32; 3]> {
        server.draw(request, &Control::SILENT).unwrap().picture.radiance
    }

    #[test]
    fn pictures_are_those_of_render_whatever_was_asked_for_before() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scene.toml");
        std::fs::write(&path, SCENE).unwrap();
        let mut server = PictureServer::new(usual(), None);
        let plain = drawn(&mut server, &request(&path, ""));
        let expected = |path: &std::path::Path| {
            let scene = load_scene(path, Shown::default()).unwrap();
            let params = RenderParams { size: [24, 16], ..usual() };
            render(&scene, &params, &Control::SILENT).unwrap().picture.radiance
        };
        assert_eq!(plain, expected(&path));

        // A view takes the place of all lights, and the next request has the file's again.
        let view = r#", "view": {"camera": {"eye": [0, 0, 6], "target": [0, 0, 0], "fov_deg": 25},
            "lights": [{"position": [1, 2, 6], "intensity": [30, 30, 30]}], "background": [0, 0, 0]}"#;
        let lit = drawn(&mut server, &request(&path, view));
        let text = "background = [0, 0, 0]\n[camera]\neye = [0, 0, 6]\ntarget = [0, 0, 0]\nfov_deg = 25\n\
                    [[light]]\nposition = [1, 2, 6]\nintensity = [30, 30, 30]\n";
        let by_file = dir.path().join("lit.toml");
        std::fs::write(&by_file, format!("{text}{SCENE}")).unwrap();
        assert_eq!(lit, expected(&by_file));
        assert_ne!(lit, plain);
        let dark = view.replace(r#""lights": [{"position": [1, 2, 6], "intensity": [30, 30, 30]}], "#, "");
        assert!(drawn(&mut server, &request(&path, &dark)).iter().flatten().all(|x| *x == 0.0));
        assert_eq!(drawn(&mut server, &request(&path, "")), plain);

        // Another text of the same file is another scene.
        std::fs::write(&path, SCENE.replace("0.5", "0.1")).unwrap();
        assert_ne!(drawn(&mut server, &request(&path, "")), plain);
    }

    #[test]
    fn a_request_that_cannot_be_met_leaves_the_next_one_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scene.toml");
        std::fs::write(&path, SCENE).unwrap();
        let mut server = PictureServer::new(usual(), None);
        let plain = drawn(&mut server, &request(&path, ""));
        let no_frames = PictureRequest { frames: 0, ..request(&path, "") };
        let no_view = request(&path, r#", "view": {"camera": {"eye": [0, 0, 0], "target": [0, 0, 0]}}"#);
        let not_there = request(&dir.path().join("none.toml"), "");
        for (bad, words) in [(no_frames, "at least 1 frame"), (no_view, "same point"), (not_there, "none.toml")] {
            let message = server.draw(&bad, &Control::SILENT).err().unwrap().to_string();
            assert!(message.contains(words) && !message.contains('\n'), "{message}");
            assert_eq!(drawn(&mut server, &request(&path, "")), plain);
        }
        assert!(
            serde_json::from_str::<PictureRequest>(r#"{"scene": "s", "size": [1, 1], "frames": 1, "x": 2}"#).is_err()
        );
    }
}
