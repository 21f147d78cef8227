//! A window that lists files to open. No crate is used: egui-file-dialog 0.15 is for another egui, and rfd brings a D-Bus
//! client on Linux.

use std::path::{Path, PathBuf};

use egui::{Context, Key, ScrollArea, TextEdit, Window};

use kiln::error::printable;
use kiln::import;

/// The list of a folder's files that kiln reads.
pub(crate) struct OpenDialog {
    /// The path as typed, absolute or relative to `folder`.
    typed: String,
    folder: PathBuf,
    /// Names of folders, with a slash, and of files, sorted.
    names: Vec<String>,
    /// Why the folder cannot be listed.
    error: Option<String>,
    /// Whether the field has yet to take the keys.
    is_new: bool,
}

/// What the user did.
pub(crate) enum Answer {
    Open,
    Picked(PathBuf),
    Closed,
}

impl OpenDialog {
    /// Lists the folder of a file.
    pub(crate) fn beside(file: Option<&Path>) -> Self {
        let folder = file.and_then(Path::parent).filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.map_or_else(|| PathBuf::from("."), Path::to_owned);
        let (typed, names, error) = (String::new(), Vec::new(), None);
        let mut dialog = OpenDialog { typed, folder: PathBuf::new(), names, error, is_new: true };
        dialog.enter(folder.canonicalize().unwrap_or(folder));
        dialog
    }

    /// Lists a folder.
    fn enter(&mut self, folder: PathBuf) {
        let listed = std::fs::read_dir(&folder).map(|entries| {
            let name = |entry: std::fs::DirEntry| {
                let name = entry.file_name().to_string_lossy().into_owned();
                let is_hidden = name.starts_with('.');
                let file = entry.path();
                match file.is_dir() {
                    true => Some(format!("{name}/")),
                    false => import::is_known(&file).then_some(name),
                }
                .filter(|_| !is_hidden)
            };
            let mut names: Vec<String> = entries.flatten().filter_map(name).collect();
            names.sort_by_key(|name| (!name.ends_with('/'), name.to_lowercase()));
            names
        });
        match listed {
            Ok(names) => {
                (self.names, self.error) = (names, None);
                (self.folder, self.typed) = (folder, String::new());
            }
            Err(e) => self.error = Some(printable(&format!("{}: {e}", folder.display())).into_owned()),
        }
    }

    /// Enters a folder, or returns a file.
    fn pick(&mut self, name: &str) -> Option<PathBuf> {
        let path = self.folder.join(name.trim());
        if path.is_dir() {
            self.enter(path);
            return None;
        }
        Some(path)
    }

    /// Names that contain what is typed, in any case of letters; all for a path.
    fn matching(&self) -> Vec<&str> {
        let typed = self.typed.to_lowercase();
        let fits = |name: &&str| typed.contains(['/', '\\']) || name.to_lowercase().contains(&typed);
        self.names.iter().map(String::as_str).filter(fits).collect()
    }

    /// What Enter opens: the path that is typed, or the first name that contains it.
    fn entered(&self) -> Option<String> {
        let typed = Some(self.typed.clone()).filter(|typed| !typed.is_empty())?;
        let is_path = typed.contains(['/', '\\']) || self.folder.join(typed.trim()).exists();
        let first = self.matching().first().filter(|_| !is_path).map(|name| (*name).to_owned());
        Some(first.unwrap_or(typed))
    }

    /// Shows the window, whose field has the keys.
    pub(crate) fn show(&mut self, context: &Context) -> Answer {
        let (mut is_open, mut is_cancelled, mut chosen) = (true, false, None);
        Window::new("Open file").open(&mut is_open).default_size([420.0, 360.0]).show(context, |ui| {
            ui.label(printable(&self.folder.to_string_lossy()));
            let edit = TextEdit::singleline(&mut self.typed).hint_text("a part of a name, or a path");
            let field = ui.add(edit.desired_width(f32::INFINITY));
            if std::mem::take(&mut self.is_new) {
                field.request_focus();
            }
            let [is_entered, is_closed] =
                [Key::Enter, Key::Escape].map(|key| ui.input(|input| input.key_pressed(key)));
            if field.lost_focus() && is_entered {
                chosen = self.entered();
                field.request_focus();
            }
            is_cancelled = is_closed;
            if let Some(error) = &self.error {
                ui.colored_label(ui.visuals().error_fg_color, error);
            }
            ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
                if self.folder.parent().is_some() && ui.selectable_label(false, "../").clicked() {
                    chosen = Some("..".to_owned());
                }
                let matching = self.matching();
                if matching.is_empty() {
                    ui.label("no file that kiln reads");
                }
                for (index, name) in matching.into_iter().enumerate() {
                    // Enter opens the first.
                    let row = ui.selectable_label(index == 0 && !self.typed.is_empty(), name);
                    if row.clicked() {
                        chosen = Some(name.to_owned());
                    }
                }
            });
        });
        let picked = chosen.and_then(|name| match name.as_str() {
            ".." => {
                self.enter(self.folder.parent().map_or(self.folder.clone(), Path::to_owned));
                None
            }
            name => self.pick(name),
        });
        match (picked, is_open && !is_cancelled) {
            (Some(file), _) => Answer::Picked(file),
            (None, true) => Answer::Open,
            (None, false) => Answer::Closed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_come_first_and_other_files_are_not_listed() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["b.obj", "A.glb", "sky.HDR", "notes.txt", ".hidden.obj"] {
            std::fs::write(folder.path().join(name), "").expect("a file");
        }
        std::fs::write(folder.path().join("other"), "v 0 0 0\n").expect("a file");
        std::fs::create_dir(folder.path().join("sub")).expect("a folder");
        let mut dialog = OpenDialog::beside(Some(&folder.path().join("b.obj")));
        assert_eq!(dialog.names, ["sub/", "A.glb", "b.obj", "other", "sky.HDR"]);
        // A part of a name finds it; a path is taken as it is.
        for (typed, matching, entered) in [
            ("", 5, None),
            ("KY", 1, Some("sky.HDR")),
            ("sub", 1, Some("sub")),
            ("x/y.obj", 5, Some("x/y.obj")),
            ("none", 0, Some("none")),
        ] {
            dialog.typed = typed.to_owned();
            assert_eq!(
                (dialog.matching().len(), dialog.entered().as_deref()),
                (matching, entered),
                "{typed}"
            );
        }
        assert_eq!(dialog.pick("sub/"), None);
        assert!(dialog.names.is_empty() && dialog.folder.ends_with("sub"));
        dialog.enter(folder.path().join("none"));
        assert!(dialog.error.is_some() && dialog.folder.ends_with("sub"));
        assert_eq!(dialog.pick("../b.obj"), Some(dialog.folder.join("../b.obj")));
    }
}
