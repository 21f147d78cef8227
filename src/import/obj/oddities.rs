//! Lines of an OBJ text that are read, but not drawn as they stand: the first of each kind.

use std::path::Path;

use crate::error::Warnings;

/// What is odd about a line.
#[derive(Debug, Clone, Copy)]
pub(super) enum Oddity {
    /// Points and lines.
    Element,
    /// Curves and surfaces.
    FreeForm,
    /// A word that is not of OBJ.
    Unknown,
    /// More numbers than a vertex has.
    Surplus,
    /// A coordinate that is infinite or not a number.
    NotFinite,
    /// A number that something else follows without a space.
    Number,
    /// A face of fewer than three corners.
    FewCorners,
}

/// The first line of each oddity, counted from 0, and the word or number that is odd.
#[derive(Debug, Default)]
pub(super) struct Oddities([Option<(usize, String)>; 7]);

impl Oddities {
    /// Records a line.
    pub(super) fn note(&mut self, oddity: Oddity, line: usize, text: impl FnOnce() -> String) {
        self.0[oddity as usize].get_or_insert_with(|| (line, text()));
    }

    /// Adds those of a part of the text that begins after `lines_before` lines.
    pub(super) fn append(&mut self, part: &Oddities, lines_before: usize) {
        for (mine, of_part) in self.0.iter_mut().zip(&part.0) {
            if let (None, Some((line, text))) = (&mine, of_part) {
                *mine = Some((lines_before + line, text.clone()));
            }
        }
    }

    /// Adds a warning or a note for each.
    pub(super) fn warn(&self, file: &Path, warnings: &mut Warnings) {
        let file = file.display();
        let [element, free_form, unknown, surplus, not_finite, number, few_corners] =
            self.0.each_ref().map(|first| first.as_ref().map(|(line, text)| (line + 1, text)));
        if element.is_some() {
            warnings.left_out(format!("{file}: points and lines are not drawn"));
        }
        if let Some((line, _)) = free_form {
            warnings.left_out(format!("{file}:{line}: free-form curves and surfaces are not drawn"));
        }
        if let Some((line, word)) = unknown {
            let what = "is not a word of OBJ files; such lines are left out";
            warnings.left_out(format!("{file}:{line}: `{word}` {what}"));
        }
        if let Some((line, count)) = surplus {
            let what = "numbers; those beyond x y z, or x y z r g b, are left out";
            warnings.left_out(format!("{file}:{line}: a vertex of {count} {what}"));
        }
        if let Some((line, count)) = few_corners {
            warnings
                .left_out(format!("{file}:{line}: a face of {count} corner(s); such faces are not drawn"));
        }
        if let Some((line, word)) = number {
            warnings.push(format!("{file}:{line}: `{word}` is read up to its last sign"));
        }
        if let Some((line, _)) = not_finite {
            warnings.note(format!("{file}:{line}: the first vertex that is not finite"));
        }
    }
}
