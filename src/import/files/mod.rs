//! Which file is read, and what it is: names, references, dependencies, contents.

pub(crate) mod contents;
pub(crate) mod dependencies;
pub(crate) mod names;
pub(crate) mod references;
pub(crate) mod uri;
