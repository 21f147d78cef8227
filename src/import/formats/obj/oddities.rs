//! Lines of an OBJ text that are read, but not drawn as they stand: the first of each kind.

use std::path::Path;

use crate::error::Warnings;

/// What is odd about a line, in the order of the warnings.
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
    /// A face of fewer than three corners.
    FewCorners,
    /// A number that something else follows without a space.
    Number,
    /// A number with a decimal comma.
    Comma,
    /// A vertex of two numbers.
    Flat,
    /// A coordinate that is infinite or not a number.
    NotFinite,
}

/// The first line of each oddity, counted from 0, and the count that is odd.
#[derive(Debug, Default)]
pub(super) struct Oddities([Option<(usize, usize)>; 9]);

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
        use Oddity::{Comma, Element, FewCorners, Flat, FreeForm, NotFinite, Number, Surplus, Unknown};
        let all = [Element, FreeForm, Unknown, Surplus, FewCorners, Number, Comma, Flat, NotFinite]
            .into_iter()
            .zip(self.0);
        for (oddity, line, count) in
            all.filter_map(|(oddity, first)| first.map(|(line, n)| (oddity, line, n)))
        {
            let at = format!("{file}:{}", line + 1);
            let what = match oddity {
                Element => format!("{file}: points and lines are not drawn"),
                FreeForm => format!("{at}: free-form curves and surfaces are not drawn"),
                Unknown => format!("{at}: not a statement of OBJ files; such lines are left out"),
                Surplus => {
                    let what = "numbers; those beyond x y z, or x y z r g b, are left out";
                    format!("{at}: a vertex of {count} {what}")
                }
                FewCorners => format!("{at}: a face of {count} corner(s); such faces are not drawn"),
                Number => format!("{at}: a number with a sign in it is read up to its last sign"),
                Comma => format!("{at}: a decimal comma is read as a point"),
                Flat => format!("{at}: a vertex without z; z = 0"),
                NotFinite => format!("{at}: the first vertex that is not finite"),
            };
            match oddity {
                Number | Comma | Flat => warnings.push(what),
                NotFinite => warnings.note(what),
                _ => warnings.left_out(what),
            }
        }
    }
}
