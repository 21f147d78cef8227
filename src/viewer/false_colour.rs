//! What is shown of a picture.

/// What is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Shown {
    /// The picture.
    #[default]
    Picture,
}

impl Shown {
    /// Everything that can be shown.
    pub const ALL: [Shown; 1] = [Shown::Picture];

    /// The name in the panel.
    pub fn name(self) -> &'static str {
        "picture"
    }
}
