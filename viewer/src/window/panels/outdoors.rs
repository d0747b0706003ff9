//! The panel's part for a scene under the sky: when, where, which air, and which of the light shines. The sky is
//! computed on a thread of its own, so that the window stays at hand.

use crate::error::ViewerError;
use crate::light::daylight::{Daylight, SunAndSky};
use crate::options::SkyLight;
use crate::scene::scene::{DaylightParts, Outdoors, Scene};
use crate::work::in_background;
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;

/// Interval at which the window asks whether the thread has computed its sky.
const ASK_AGAIN: Duration = Duration::from_millis(30);

/// A sky in the making.
struct Work {
    daylight: Daylight,
    light: Receiver<Result<SunAndSky, ViewerError>>,
}

/// State of the panel for sun and sky.
pub(crate) struct OutdoorsPanel {
    /// The day as the panel shows it; the scene follows.
    shown: Outdoors,
    date_time: String,
    place: String,
    /// The last sky, and of which day it is.
    light: Option<(Daylight, SunAndSky)>,
    work: Option<Work>,
    message: Option<String>,
}

impl OutdoorsPanel {
    /// Takes over the day of a scene; `None` for one that is not under a sky of a known day.
    pub(crate) fn new(scene: &Scene) -> Option<OutdoorsPanel> {
        let shown = scene.outdoors.clone()?;
        let place = shown.daylight.place;
        let numbers = [place.latitude_deg, place.longitude_deg, place.height_m].map(|x| x.to_string());
        Some(OutdoorsPanel {
            date_time: shown.daylight.date_time.to_string(),
            place: numbers.join(", "),
            shown,
            light: None,
            work: None,
            message: None,
        })
    }

    /// Draws the panel; returns `true` if the scene's light changed.
    pub(crate) fn show(&mut self, ui: &mut egui::Ui, scene: &mut Scene, sky: &mut SkyLight) -> bool {
        let daylight = &mut self.shown.daylight;
        let mut text_changed = false;
        ui.horizontal(|ui| {
            text_changed |= ui.add(egui::TextEdit::singleline(&mut self.date_time).desired_width(190.0)).lost_focus();
            ui.label("date, time");
        });
        ui.horizontal(|ui| {
            text_changed |= ui.add(egui::TextEdit::singleline(&mut self.place).desired_width(190.0)).lost_focus();
            ui.label("place").on_hover_text("degrees north and east, metres above the sea");
        });
        if text_changed {
            match Daylight::new(&self.date_time, &self.place) {
                Ok(typed) => {
                    (daylight.date_time, daylight.place) = (typed.date_time, typed.place);
                    self.message = None;
                }
                Err(error) => self.message = Some(error.to_string()),
            }
        }
        if let Some(mut minutes) = minutes_of(daylight) {
            let slider = egui::Slider::new(&mut minutes, 0..=24 * 60 - 1)
                .custom_formatter(|x, _| format!("{:02}:{:02}", x as u32 / 60, x as u32 % 60))
                .custom_parser(|text| {
                    let (hours, minutes) = text.split_once(':')?;
                    Some(60.0 * hours.trim().parse::<f64>().ok()? + minutes.trim().parse::<f64>().ok()?)
                });
            if ui.add(slider.text("time of day")).changed() {
                set_minutes(daylight, minutes);
                self.date_time = daylight.date_time.to_string();
            }
        }
        let turbidity = egui::Slider::new(&mut daylight.turbidity, 1.0..=10.0).text("turbidity");
        ui.add(turbidity).on_hover_text("haze: 1 is air alone, 3 a clear day, 6 a hazy one");
        ui.add(egui::Slider::new(&mut daylight.ground_albedo, 0.0..=1.0).text("ground's albedo"));
        ui.horizontal(|ui| {
            for (parts, name) in
                [(DaylightParts::Both, "sun and sky"), (DaylightParts::Sun, "sun"), (DaylightParts::Sky, "sky")]
            {
                ui.radio_value(&mut self.shown.parts, parts, name);
            }
        });
        ui.horizontal(|ui| {
            ui.label("sky by");
            for way in [SkyLight::Rays, SkyLight::Irradiance] {
                ui.radio_value(sky, way, way.name());
            }
        });
        let changed = self.follow(scene);
        if self.work.is_some() {
            ui.small("computing the sky ...");
            ui.ctx().request_repaint_after(ASK_AGAIN);
        }
        if let Some(message) = &self.message {
            ui.colored_label(egui::Color32::LIGHT_RED, message);
        }
        changed
    }

    /// Brings the scene nearer to what is shown: takes over a sky that is there, asks for one that is not; `true` if
    /// the scene's light changed.
    fn follow(&mut self, scene: &mut Scene) -> bool {
        if let Some(work) = &self.work {
            match work.light.try_recv() {
                Ok(Ok(light)) => self.light = Some((work.daylight.clone(), light)),
                Ok(Err(error)) => self.give_up(scene, error.to_string()),
                Err(TryRecvError::Empty) => return false,
                Err(TryRecvError::Disconnected) => self.give_up(scene, "the sky could not be computed".into()),
            }
            self.work = None;
        }
        let under = scene.outdoors.as_ref();
        // While a slider is dragged each sky that is there is shown, though another one is asked for by then.
        let latest = self.light.as_ref().map(|(daylight, light)| {
            let outdoors = Outdoors { daylight: daylight.clone(), parts: self.shown.parts };
            (outdoors, light)
        });
        let mut changed = false;
        if let Some((outdoors, light)) = latest.filter(|(outdoors, _)| under != Some(outdoors)) {
            let lights = std::mem::take(&mut scene.lights);
            scene.stand_outdoors(outdoors, light.clone());
            scene.lights = lights;
            changed = true;
        }
        if scene.outdoors.as_ref() != Some(&self.shown) {
            let daylight = self.shown.daylight.clone();
            let asked = daylight.clone();
            self.work = Some(Work { daylight, light: in_background(move || asked.sun_and_sky()) });
        }
        changed
    }

    /// Shows what the scene has again.
    fn give_up(&mut self, scene: &Scene, message: String) {
        if let Some(outdoors) = &scene.outdoors {
            self.shown = outdoors.clone();
        }
        self.message = Some(message);
    }
}

/// Returns the minutes since midnight, where the day has a time.
fn minutes_of(daylight: &Daylight) -> Option<u32> {
    daylight.date_time.time.map(|time| 60 * u32::from(time.hour) + u32::from(time.minute))
}

fn set_minutes(daylight: &mut Daylight, minutes: u32) {
    if let Some(time) = &mut daylight.date_time.time {
        (time.hour, time.minute) = ((minutes / 60) as u8, (minutes % 60) as u8);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::asset::SceneAsset;
    use crate::scene::scene::{MeshChoice, PointLight};
    use glam::Vec3;
    use std::sync::Arc;

    fn scene(parts: DaylightParts) -> Scene {
        let mut scene = Scene::built_in(&MeshChoice::Plane, vec![Arc::new(SceneAsset::built_in())], [1.0; 2]).unwrap();
        let daylight = Daylight::new("2026-06-21T12:00+02:00", "52.5,13.4").unwrap();
        let light = daylight.sun_and_sky().unwrap();
        scene.stand_outdoors(Outdoors { daylight, parts }, light);
        scene
    }

    /// Follows until nothing is in the making; how often the scene's light changed.
    fn settle(panel: &mut OutdoorsPanel, scene: &mut Scene) -> usize {
        let mut changes = 0;
        loop {
            changes += usize::from(panel.follow(scene));
            if panel.work.is_none() {
                return changes;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    #[test]
    fn the_scene_follows_the_time_of_day_and_keeps_its_lamps() {
        let mut scene = scene(DaylightParts::Both);
        scene.lights = vec![PointLight { position: Vec3::Y, intensity: [1.0; 3] }];
        let mut panel = OutdoorsPanel::new(&scene).unwrap();
        let noon = scene.sun.unwrap();
        assert_eq!(settle(&mut panel, &mut scene), 0);
        set_minutes(&mut panel.shown.daylight, 19 * 60 + 30);
        assert_eq!(minutes_of(&panel.shown.daylight), Some(1170));
        assert_eq!(settle(&mut panel, &mut scene), 1);
        let (evening, expected) = (scene.sun.unwrap(), panel.shown.daylight.sun_and_sky().unwrap());
        assert!(evening.direction.y < noon.direction.y && Some(evening) == expected.sun);
        assert_eq!(scene.environment.as_deref(), Some(&expected.environment));
        assert_eq!((scene.lights.len(), scene.outdoors.as_ref()), (1, Some(&panel.shown)));
    }

    #[test]
    fn one_part_of_the_light_is_as_large_as_both() {
        let mut scene = scene(DaylightParts::Sun);
        let size = scene.environment.as_ref().unwrap().size();
        let mut panel = OutdoorsPanel::new(&scene).unwrap();
        panel.shown.parts = DaylightParts::Sky;
        assert_eq!(settle(&mut panel, &mut scene), 1);
        assert_eq!((scene.sun, scene.environment.as_ref().unwrap().size()), (None, size));
        assert!(scene.environment.as_ref().unwrap().irradiance(Vec3::Y).y > 0.0);
        // The sky is at hand now.
        panel.shown.parts = DaylightParts::Both;
        assert!(panel.follow(&mut scene) && panel.work.is_none() && scene.sun.is_some());
    }

    #[test]
    fn a_day_that_is_none_leaves_the_scene_as_it_is() {
        let mut scene = scene(DaylightParts::Both);
        let before = scene.outdoors.clone();
        let mut panel = OutdoorsPanel::new(&scene).unwrap();
        panel.shown.daylight.turbidity = 99.0;
        assert_eq!(settle(&mut panel, &mut scene), 0);
        assert!(panel.message.as_ref().unwrap().contains("turbidity"), "{:?}", panel.message);
        assert_eq!((&scene.outdoors, Some(panel.shown)), (&before, before.clone()));
        scene.outdoors = None;
        assert!(OutdoorsPanel::new(&scene).is_none());
    }
}
