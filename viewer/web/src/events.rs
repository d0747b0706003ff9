//! What the user does, from the page's words to those of the user interface.

use egui::{Event, Modifiers, PointerButton, TouchDeviceId, TouchId, TouchPhase, Vec2, pos2};

/// Returns the keys that are held down beside others, from bits: 1 Shift, 2 Ctrl, 4 Alt, 8 Meta.
pub(crate) fn modifiers(bits: u32) -> Modifiers {
    let [shift, ctrl, alt, meta] = [1, 2, 4, 8].map(|bit| bits & bit != 0);
    Modifiers { alt, ctrl, shift, mac_cmd: meta, command: ctrl || meta }
}

/// Returns a button that is pressed or released, by its number in JavaScript.
pub(crate) fn pointer_button(at: [f32; 2], button: u32, pressed: bool, modifiers: Modifiers) -> Event {
    let button = match button {
        1 => PointerButton::Middle,
        2 => PointerButton::Secondary,
        3 => PointerButton::Extra1,
        4 => PointerButton::Extra2,
        _ => PointerButton::Primary,
    };
    Event::PointerButton { pos: pos2(at[0], at[1]), button, pressed, modifiers }
}

/// Returns a turn of the wheel, in points or, with `lines`, in lines.
pub(crate) fn wheel(delta: [f32; 2], lines: bool, modifiers: Modifiers) -> Event {
    let unit = if lines { egui::MouseWheelUnit::Line } else { egui::MouseWheelUnit::Point };
    Event::MouseWheel {
        unit,
        delta: -Vec2::from(delta),
        phase: TouchPhase::Move,
        source: egui::MouseWheelSource::Unknown,
        modifiers,
    }
}

/// Returns what a finger does: `phase` is 0 where it comes, 1 where it moves, 2 where it leaves, else where that is cancelled.
pub(crate) fn touch(id: u32, phase: u32, at: [f32; 2]) -> Event {
    let phase = match phase {
        0 => TouchPhase::Start,
        1 => TouchPhase::Move,
        2 => TouchPhase::End,
        _ => TouchPhase::Cancel,
    };
    Event::Touch { device_id: TouchDeviceId(0), id: TouchId(id.into()), phase, pos: pos2(at[0], at[1]), force: None }
}

/// Returns a key that is pressed or released, by its name in JavaScript; none for keys that are not known.
pub(crate) fn key(name: &str, pressed: bool, repeat: bool, modifiers: Modifiers) -> Option<Event> {
    // Keys of letters are named by capitals.
    let name = if name.chars().count() == 1 { name.to_uppercase() } else { name.into() };
    let name = if name == " " { "Space".into() } else { name };
    let key = egui::Key::from_name(&name)?;
    Some(Event::Key { key, physical_key: None, pressed, repeat, modifiers })
}
