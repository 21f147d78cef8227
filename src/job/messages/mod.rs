//! What is said about a picture: findings, notes, options without effect.

pub(crate) mod back_faces;
pub(crate) mod findings;
pub(crate) mod notes;
pub(crate) mod outside;
pub(crate) mod unused;
