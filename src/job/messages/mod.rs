//! Warnings and notes about a picture.

pub(crate) mod back_faces;
pub(crate) mod findings;
pub(crate) mod notes;
pub(crate) mod outside;
pub(crate) mod unused;
