//! What the window remembers from one run to the next.

use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Written when the window closes; a file that cannot be read is as good as none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Settings {
    /// Width and height of the window, pixels.
    pub size: [u32; 2],
    /// Name of the renderer that was chosen in the panel.
    pub renderer: Option<String>,
    /// Handles of the lights in the picture.
    pub light_handles: bool,
    /// Radius of the brush, texels.
    pub brush_radius: f32,
    /// Factor on displayed differences.
    pub difference_gain: f32,
    /// Drags turn the view about the eye.
    pub fly: bool,
    /// Noise is filtered out of pictures while nothing moves.
    pub denoise: bool,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            size: [1100, 760],
            renderer: None,
            light_handles: true,
            brush_radius: 8.0,
            difference_gain: 8.0,
            fly: false,
            denoise: false,
        }
    }
}

/// Returns `btf-view/settings.toml` in the user's folder for settings, where there is one.
fn path() -> Option<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let folder = variable("XDG_CONFIG_HOME")
        .or_else(|| variable("APPDATA"))
        .or_else(|| variable("HOME").map(|home| home.join(".config")))?;
    Some(folder.join("btf-view").join("settings.toml"))
}

impl Settings {
    pub(crate) fn load() -> Settings {
        let text = path().and_then(|path| std::fs::read_to_string(path).ok());
        text.map_or_else(Settings::default, |text| Settings::read(&text))
    }

    fn read(text: &str) -> Settings {
        let read: Settings = toml::from_str(text).unwrap_or_default();
        let usual = Settings::default();
        let positive = |x: f32, usual: f32| if x.is_finite() && x > 0.0 { x } else { usual };
        Settings {
            size: if read.size.iter().all(|side| (64..=16384).contains(side)) { read.size } else { usual.size },
            brush_radius: positive(read.brush_radius, usual.brush_radius),
            difference_gain: positive(read.difference_gain, usual.difference_gain),
            ..read
        }
    }

    /// Writes the settings. A failure is no reason to keep the user, and is ignored.
    pub(crate) fn save(&self) {
        let Some(path) = path() else { return };
        let (Some(folder), Ok(text)) = (path.parent(), toml::to_string(self)) else { return };
        if std::fs::create_dir_all(folder).is_ok() {
            let _ = btf_capture::atomic::write_file_atomically(&path, text.as_bytes());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_come_back_and_bad_ones_are_the_usual_ones() {
        let changed = Settings {
            size: [800, 600],
            renderer: Some("cpu".into()),
            fly: true,
            denoise: true,
            ..Settings::default()
        };
        assert_eq!(Settings::read(&toml::to_string(&changed).unwrap()), changed);
        for text in ["", "nonsense", "size = [1, 1]\nbrush_radius = nan", "size = \"x\""] {
            assert_eq!(Settings::read(text), Settings::default(), "{text}");
        }
    }
}
