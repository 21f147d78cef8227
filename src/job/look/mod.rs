//! The default look, what calls for paths, and the exposure.

pub(crate) mod default_look;
pub(crate) mod metering;
pub(crate) mod path_calls;
