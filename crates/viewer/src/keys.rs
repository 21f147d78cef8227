//! Key bindings and the text of the key list.

use egui::{Context, Event, InputState, Key, Modifiers, Popup};
use glam::{DVec2, DVec3};

/// Action of a key or button.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Action {
    /// Switches the projection.
    Projection,
    /// Restores the initial camera.
    Reset,
    /// Fits the scene, in the view [`StandardView::Auto`](kiln::world::StandardView::Auto).
    Fit,
    /// Selects a standard view.
    Standard(kiln::world::StandardView),
    /// Selects the next camera of the scene.
    NextCamera,
    /// Selects the next display mode.
    NextShown,
    /// Magnifies the displayed pixels, or shows all again.
    Magnify,
    /// Starts or pauses the animation.
    Play,
    /// Moves by a number of frames.
    Step(i32),
    /// Shows the animation's first frame.
    Rewind,
    /// Shows or hides the list of files to open.
    Open,
    /// Saves the picture.
    SavePicture,
    /// Copies the camera.
    CopyCamera,
    /// Copies the command line.
    CopyCommand,
    /// Undoes or redoes a change of camera, look or visible objects.
    Undo,
    Redo,
    /// Reads the files again.
    Reload,
    /// Shows or hides the panel.
    Panel,
    /// Toggles full screen.
    FullScreen,
    /// Switches between the dark and the light theme.
    Theme,
    /// Shows or hides the list of keys.
    Help,
    /// Closes the key list, the notice and the inspector.
    Close,
}

use kiln::world::StandardView::{Back, Bottom, Front, Iso, Left, Right, Top};

/// A key with its modifiers, and its action.
pub(crate) struct Binding {
    modifiers: Modifiers,
    key: Key,
    action: Action,
}

const fn plain(key: Key, action: Action) -> Binding {
    Binding { modifiers: Modifiers::NONE, key, action }
}

const fn shift(key: Key, action: Action) -> Binding {
    Binding { modifiers: Modifiers::SHIFT, key, action }
}

const fn control(key: Key, action: Action) -> Binding {
    Binding { modifiers: Modifiers::COMMAND, key, action }
}

/// Bindings with modifiers come first, because a binding without modifiers also matches a key with modifiers.
const BINDINGS: &[Binding] = &[
    control(Key::O, Action::Open),
    control(Key::S, Action::SavePicture),
    control(Key::K, Action::CopyCamera),
    control(Key::L, Action::CopyCommand),
    Binding { modifiers: Modifiers::COMMAND.plus(Modifiers::SHIFT), key: Key::Z, action: Action::Redo },
    control(Key::Y, Action::Redo),
    control(Key::Z, Action::Undo),
    control(Key::Num1, Action::Standard(Back)),
    control(Key::Num3, Action::Standard(Left)),
    control(Key::Num7, Action::Standard(Bottom)),
    plain(Key::Enter, Action::Projection),
    plain(Key::Num1, Action::Standard(Front)),
    plain(Key::Num3, Action::Standard(Right)),
    plain(Key::Num5, Action::Projection),
    plain(Key::Num7, Action::Standard(Top)),
    plain(Key::Num9, Action::Standard(Iso)),
    plain(Key::R, Action::Reset),
    plain(Key::Home, Action::Reset),
    plain(Key::F, Action::Fit),
    plain(Key::C, Action::NextCamera),
    plain(Key::V, Action::NextShown),
    plain(Key::Z, Action::Magnify),
    plain(Key::F1, Action::Help),
    plain(Key::F5, Action::Reload),
    plain(Key::F11, Action::FullScreen),
    plain(Key::Space, Action::Play),
    plain(Key::Comma, Action::Step(-1)),
    plain(Key::Period, Action::Step(1)),
    plain(Key::Backspace, Action::Rewind),
    plain(Key::H, Action::Panel),
    plain(Key::T, Action::Theme),
    shift(Key::Questionmark, Action::Help),
    plain(Key::Questionmark, Action::Help),
    plain(Key::Escape, Action::Close),
];

/// Text of the key list: keys and actions.
pub(crate) const LIST: &[(&str, &str)] = &[
    ("Drag", "orbit"),
    ("Shift + drag, right or middle button", "pan"),
    ("Wheel", "zoom, to what is under the mouse; + and - to the middle"),
    ("Ctrl + drag", "look around"),
    ("W A S D, Q E", "fly; with Shift faster"),
    ("Arrows", "orbit"),
    ("Click", "what is in a pixel, and the rays it cast; orbit about it, focus on it"),
    ("Double click", "move what is there to the middle"),
    ("Enter, 5", "perspective or orthographic"),
    ("1 3 7 9", "from the front, right, top, corner; with Ctrl from the other side"),
    ("F", "all of the scene in the picture, as it is at this frame"),
    ("R, Home", "back to where it was first seen from"),
    ("C", "next camera of the scene"),
    ("V", "next false colours"),
    ("Z", "magnify the pixels under the mouse; then wheel and drag change what is seen; Z or Esc ends"),
    ("Space", "play or pause the animation"),
    (", and .", "one frame back or forth; Backspace for the first"),
    ("Ctrl + O", "open a file: type a part of its name, then Enter"),
    ("Drop files", "open them together; .hdr and .exr light the scene"),
    ("Ctrl + S", "save the picture"),
    ("Ctrl + K", "copy the camera, for a scene file"),
    ("Ctrl + L", "copy the command line that renders the picture"),
    ("Ctrl + Z", "undo a change of camera, look or visible objects; with Shift redo"),
    ("F5", "read the files again (they are watched, too)"),
    ("H", "hide or show the panel"),
    ("Tab", "from one control to the next; Space or arrows change it"),
    ("T", "dark or light"),
    ("F11", "full screen"),
    ("Esc", "close what is open"),
    ("? or F1", "these keys"),
];

/// Keyboard focus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Focus {
    /// The picture.
    Picture,
    /// A control, which handles Enter, Space and Escape; all other keys act as in the picture.
    Control,
    /// A control in text entry, which handles all keys that type text.
    Text,
}

impl Focus {
    /// The focus of this frame.
    pub(crate) fn of(context: &Context) -> Focus {
        // An open list of values, too.
        let is_control = context.egui_wants_keyboard_input() || Popup::is_any_open(context);
        match (context.text_edit_focused(), is_control) {
            (true, _) => Focus::Text,
            (false, true) => Focus::Control,
            (false, false) => Focus::Picture,
        }
    }

    /// Whether the focused control handles a key.
    fn takes(self, modifiers: Modifiers, key: Key) -> bool {
        let is_of_controls = matches!(key, Key::Enter | Key::Space | Key::Escape);
        let is_edited = [Key::Z, Key::Y].contains(&key);
        let is_typed = (!modifiers.command || is_edited) && !(Key::F1..=Key::F12).contains(&key);
        match self {
            Focus::Picture => false,
            Focus::Control => is_of_controls,
            Focus::Text => is_of_controls || is_typed,
        }
    }
}

/// Actions of the pressed keys. The key events are removed from `input`.
pub(crate) fn actions(input: &mut InputState, focus: Focus) -> Vec<Action> {
    let mut actions = Vec::new();
    for Binding { modifiers, key, action } in BINDINGS {
        if focus.takes(*modifiers, *key) {
            continue;
        }
        for _ in 0..input.count_and_consume_key(*modifiers, *key) {
            actions.push(*action);
        }
    }
    actions
}

/// Movement keys that are held down. Keys pressed with Ctrl or Alt are ignored, since those are shortcuts.
#[derive(Default)]
pub(crate) struct HeldKeys(Vec<Key>);

/// Camera motion by keys.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct CameraMotion {
    /// Flight to the right, up and forward, each -1, 0 or 1.
    pub fly: DVec3,
    /// Orbit to the right and up, each -1, 0 or 1.
    pub orbit: DVec2,
    /// Key presses that zoom in minus those that zoom out, with key repeats. Presses are counted instead of held keys,
    /// because `+` needs Shift on many keyboards: if Shift is released first, the release event is that of another key.
    pub zoom: f64,
}

impl HeldKeys {
    /// Updates the held keys. Arrows are ignored while a control has the focus.
    pub(crate) fn update(&mut self, input: &InputState, focus: Focus) {
        if !input.focused {
            // Releases are not reported to a window without focus.
            self.0.clear();
        }
        for event in &input.events {
            let Event::Key { key, pressed, modifiers, .. } = event else { continue };
            let arrows = [Key::ArrowLeft, Key::ArrowRight, Key::ArrowUp, Key::ArrowDown];
            let is_others = modifiers.command
                || modifiers.alt
                || focus == Focus::Text
                || focus == Focus::Control && arrows.contains(key);
            self.0.retain(|held| held != key);
            if *pressed && !is_others {
                self.0.push(*key);
            }
        }
    }

    /// The camera motion of this frame.
    pub(crate) fn motion(&self, input: &InputState, focus: Focus) -> CameraMotion {
        let axis = |minus: Key, plus: Key| {
            f64::from(i8::from(self.0.contains(&plus)) - i8::from(self.0.contains(&minus)))
        };
        use Key::{A, ArrowDown, ArrowLeft, ArrowRight, ArrowUp, D, E, Q, S, W};
        let presses = |key: Key| input.num_presses(key) as f64;
        let is_plain = focus == Focus::Picture && !input.modifiers.command;
        let zoom = presses(Key::Plus) + presses(Key::Equals) - presses(Key::Minus);
        CameraMotion {
            fly: DVec3::new(axis(A, D), axis(Q, E), axis(S, W)),
            orbit: DVec2::new(axis(ArrowLeft, ArrowRight), axis(ArrowDown, ArrowUp)),
            zoom: if is_plain { zoom } else { 0.0 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pressed(key: Key, modifiers: Modifiers) -> InputState {
        let mut input = InputState::default();
        let event = Event::Key { key, physical_key: Some(key), pressed: true, repeat: false, modifiers };
        input.events.push(event);
        input.focused = true;
        input
    }

    #[test]
    fn what_is_typed_into_a_field_does_nothing_else() {
        let plain = Modifiers::NONE;
        for key in [Key::Num1, Key::Num5, Key::Period, Key::Backspace, Key::C, Key::Enter, Key::Space] {
            assert_eq!(actions(&mut pressed(key, plain), Focus::Text), [], "{key:?}");
            assert_eq!(actions(&mut pressed(key, plain), Focus::Picture).len(), 1, "{key:?}");
        }
        for (key, modifiers) in [(Key::F5, plain), (Key::S, Modifiers::COMMAND)] {
            assert_eq!(actions(&mut pressed(key, modifiers), Focus::Text).len(), 1, "{key:?}");
        }
        let control_shift = Modifiers::COMMAND.plus(Modifiers::SHIFT);
        for (modifiers, action) in
            [(plain, Action::Magnify), (Modifiers::COMMAND, Action::Undo), (control_shift, Action::Redo)]
        {
            assert_eq!(actions(&mut pressed(Key::Z, modifiers), Focus::Picture), [action]);
            assert_eq!(actions(&mut pressed(Key::Z, modifiers), Focus::Text), []);
        }
        // A focused control handles its own keys only.
        for (key, count) in [(Key::Space, 0), (Key::Enter, 0), (Key::C, 1)] {
            assert_eq!(actions(&mut pressed(key, plain), Focus::Control).len(), count, "{key:?}");
        }
    }

    #[test]
    fn keys_fly_while_they_are_held_and_not_with_control() {
        let fly = |key, modifiers, focus| {
            let mut held = HeldKeys::default();
            let input = pressed(key, modifiers);
            held.update(&input, focus);
            held.motion(&input, focus)
        };
        assert_eq!(fly(Key::W, Modifiers::NONE, Focus::Picture).fly, DVec3::Z);
        assert_eq!(fly(Key::S, Modifiers::NONE, Focus::Control).fly, -DVec3::Z);
        assert_eq!(fly(Key::ArrowUp, Modifiers::NONE, Focus::Picture).orbit, DVec2::Y);
        for (key, modifiers, focus) in [
            (Key::S, Modifiers::COMMAND, Focus::Picture),
            (Key::W, Modifiers::NONE, Focus::Text),
            (Key::ArrowUp, Modifiers::NONE, Focus::Control),
        ] {
            assert_eq!(fly(key, modifiers, focus), CameraMotion::default(), "{key:?}");
        }
    }
}
