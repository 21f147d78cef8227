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

/// The first line of each oddity, counted from 0, and the count that is odd.
#[derive(Debug, Default)]
pub(super) struct Oddities([Option<(usize, usize)>; 7]);

impl Oddities {
    /// Records a line.
    pub(super) fn note(&mut self, oddity: Oddity, line: usize) {
        self.note_count(oddity, line, 0);
    }

    /// Records a line with an odd count.
    pub(super) fn note_count(&mut self, oddity: Oddity, line: usize, count: usize) {
        self.0[oddity as usize].get_or_insert((line, count));
    }

    /// Adds those of a part of the text that begins after `lines_before` lines.
    pub(super) fn append(&mut self, part: &Oddities, lines_before: usize) {
        for (mine, of_part) in self.0.iter_mut().zip(&part.0) {
            *mine = mine.or(of_part.map(|(line, count)| (lines_before + line, count)));
        }
    }

    /// Adds a warning or a note for each.
    pub(super) fn warn(&self, file: &Path, warnings: &mut Warnings) {
        let file = file.display();
        let [element, free_form, unknown, surplus, not_finite, number, few_corners] =
            self.0.map(|first| first.map(|(line, count)| (line + 1, count)));
        if element.is_some() {
            warnings.left_out(format!("{file}: points and lines are not drawn"));
        }
        if let Some((line, _)) = free_form {
            warnings.left_out(format!("{file}:{line}: free-form curves and surfaces are not drawn"));
        }
        if let Some((line, _)) = unknown {
            let what = "not a statement of OBJ files; such lines are left out";
            warnings.left_out(format!("{file}:{line}: {what}"));
        }
        if let Some((line, count)) = surplus {
            let what = "numbers; those beyond x y z, or x y z r g b, are left out";
            warnings.left_out(format!("{file}:{line}: a vertex of {count} {what}"));
        }
        if let Some((line, count)) = few_corners {
            warnings
                .left_out(format!("{file}:{line}: a face of {count} corner(s); such faces are not drawn"));
        }
        if let Some((line, _)) = number {
            warnings.push(format!("{file}:{line}: a number with a sign in it is read up to its last sign"));
        }
        if let Some((line, _)) = not_finite {
            warnings.note(format!("{file}:{line}: the first vertex that is not finite"));
        }
    }
}
